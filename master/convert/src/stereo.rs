//! Eyes and ways of stereo, as wall files name them.
//! Plain data.

/// For which eye a channel is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Eye {
    #[default]
    Centre,
    Left,
    Right,
}

impl Eye {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Centre => "centre",
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// How the pictures of both eyes share one output.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Stereo {
    #[default]
    Off,
    SideBySide,
    TopBottom,
    RedCyan,
    GreenMagenta,
    AmberBlue,
    InterlacedRows,
    Checkerboard,
}

impl Stereo {
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::SideBySide => "side-by-side",
            Self::TopBottom => "top-bottom",
            Self::RedCyan => "anaglyph-red-cyan",
            Self::GreenMagenta => "anaglyph-green-magenta",
            Self::AmberBlue => "anaglyph-amber-blue",
            Self::InterlacedRows => "interlaced-rows",
            Self::Checkerboard => "checkerboard",
        }
    }
}

/// What to do about a picture pair that only a stereo graphics driver can show.
pub(crate) const QUAD_BUFFER: (&str, &str) = (
    "pairs of pictures from the graphics driver (quad buffers) are not a way of stereo here, so it shows the middle between the eyes",
    "set the projector to side by side or top-bottom and write stereo = \"side-by-side\" or \"top-bottom\", or feed it from two outputs with eye = \"left\" and \"right\"",
);
