//! The description of an archive: profile, buffers and regions.
//! In: XML text. Out: what the regions are and which parts they have. It opens no part.

use super::fileset::FileSet;
use super::xml::{self, Element};
use crate::{Axes, CanvasPlace, Frustum, MAX_SIZE_PX, ReadError};

/// What the geometry of an archive is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Profile {
    /// `2d`: places on a canvas.
    TwoD,
    /// `3d`: places in a picture with a frustum.
    ThreeD,
    /// `a3`: points of the screen.
    AdvancedThreeD,
    /// `sl`: points of the screen and a projector.
    ShaderLamp,
}

/// The place and the axes of a projector, in the file's coordinates and unit.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    pub(super) position: [f64; 3],
    pub(super) axes: Axes,
}

impl Default for Frame {
    fn default() -> Self {
        Self {
            position: [0.0; 3],
            axes: Axes::ROOM,
        }
    }
}

/// A region and its files.
pub(super) struct RegionEntry {
    pub(super) name: String,
    pub(super) size_px: [u32; 2],
    pub(super) canvas: CanvasPlace,
    pub(super) frustum: Option<Frustum>,
    pub(super) frame: Option<Frame>,
    pub(super) files: FileSet,
    pub(super) notes: Vec<String>,
}

/// A description.
pub(super) struct Document {
    pub(super) profile: Profile,
    pub(super) date: String,
    pub(super) regions: Vec<RegionEntry>,
    pub(super) notes: Vec<String>,
}

impl Document {
    pub(super) fn parse(text: &str, file: &str, most_regions: usize) -> Result<Self, ReadError> {
        let parsed = xml::parse(text, file)?;
        let root = Element {
            node: parsed.root_element(),
            file,
        };
        if !root.is("MPCDI") {
            return Err(root.refuse("the root element", root.name(), "<MPCDI>"));
        }
        let version = root.attribute("version").unwrap_or("1.0");
        let major = version.split('.').next().unwrap_or("");
        if !["1", "2"].contains(&major) {
            return Err(ReadError::Unsupported {
                file: file.to_owned(),
                what: format!("version {version}"),
                remedy: "Export the archive as MPCDI 1.0 or 2.0.",
            });
        }
        let profile = match root
            .needed_attribute("profile")?
            .to_ascii_lowercase()
            .as_str()
        {
            "2d" => Profile::TwoD,
            "3d" => Profile::ThreeD,
            "a3" => Profile::AdvancedThreeD,
            "sl" => Profile::ShaderLamp,
            other => return Err(root.refuse("profile", other, "2d, 3d, a3 or sl")),
        };
        let mut document = Self {
            profile,
            date: root.attribute("date").unwrap_or("").to_owned(),
            regions: Vec::new(),
            notes: unread(root, &["display", "files"]),
        };
        let display = root.needed_child("display")?;
        let count = display
            .children()
            .map(|buffer| {
                buffer
                    .children()
                    .filter(|region| region.is("region"))
                    .count()
            })
            .sum::<usize>();
        if count > most_regions {
            return Err(ReadError::TooMany {
                file: file.to_owned(),
                what: "regions",
                count: count as u64,
                limit: most_regions as u64,
            });
        }
        for buffer in display.children().filter(|child| child.is("buffer")) {
            document.notes.extend(unread(buffer, &["region"]));
            for region in buffer.children().filter(|child| child.is("region")) {
                let entry = read_region(root, buffer, region, profile)?;
                if document
                    .regions
                    .iter()
                    .any(|known| known.name == entry.name)
                {
                    return Err(ReadError::DuplicateRegion {
                        file: file.to_owned(),
                        region: entry.name,
                    });
                }
                document.regions.push(entry);
            }
        }
        if document.regions.is_empty() {
            return Err(display.missing("<buffer> with a <region>"));
        }
        Ok(document)
    }
}

/// Most names of unknown elements that are listed: telling where one stands costs time.
const MOST_NOTES: usize = 8;

/// A note for each kind of child that is not read.
pub(super) fn unread(element: Element<'_, '_>, known: &[&str]) -> Vec<String> {
    let mut kinds: Vec<(Element<'_, '_>, usize)> = Vec::new();
    let mut further = 0_usize;
    for child in element
        .children()
        .filter(|child| !known.iter().any(|name| child.is(name)))
    {
        if let Some((_, count)) = kinds.iter_mut().find(|(kind, _)| kind.is(child.name())) {
            *count += 1;
        } else if kinds.len() < MOST_NOTES {
            kinds.push((child, 1));
        } else {
            further += 1;
        }
    }
    let note = |(kind, count): &(Element<'_, '_>, usize)| {
        let (file, line, name) = (kind.file, kind.line(), kind.name());
        match count {
            1 => format!("{file}:{line}: <{name}> is not read"),
            more => format!("{file}:{line}: <{name}> is not read; there are {more} of it"),
        }
    };
    let mut notes: Vec<String> = kinds.iter().map(note).collect();
    if further > 0 {
        notes.push(format!(
            "{}: {further} further elements are not read",
            element.file
        ));
    }
    notes
}

fn read_region(
    root: Element<'_, '_>,
    buffer: Element<'_, '_>,
    region: Element<'_, '_>,
    profile: Profile,
) -> Result<RegionEntry, ReadError> {
    let name = region.needed_attribute("id")?.to_owned();
    let mut notes = unread(region, &["frustum", "coordinateFrame"]);
    let frustum = region.child("frustum");
    let has_frustum = matches!(profile, Profile::ThreeD | Profile::ShaderLamp);
    let frustum = match frustum {
        Some(frustum) if has_frustum => Some(read_frustum(frustum)?),
        None if has_frustum => return Err(region.missing("<frustum>")),
        Some(frustum) => {
            notes.push(format!(
                "{}:{}: <frustum> is only read in the profiles 3d and sl",
                frustum.file,
                frustum.line()
            ));
            None
        }
        None => None,
    };
    let frame = match region.child("coordinateFrame") {
        Some(frame) if profile == Profile::ShaderLamp => Some(read_frame(frame)?),
        None if profile == Profile::ShaderLamp => return Err(region.missing("<coordinateFrame>")),
        Some(frame) => {
            notes.push(format!(
                "{}:{}: <coordinateFrame> is only read in the profile sl",
                frame.file,
                frame.line()
            ));
            None
        }
        None => None,
    };
    let has_points = matches!(profile, Profile::AdvancedThreeD | Profile::ShaderLamp);
    let files = root.needed_child("files")?;
    let mut own = files
        .children()
        .filter(|set| set.is("fileset") && set.attribute("region") == Some(&name));
    let set = own
        .next()
        .ok_or_else(|| files.missing(&format!("<fileset region=\"{name}\">")))?;
    if let Some(second) = own.next() {
        return Err(second.refuse("region", &name, "one fileset for each region"));
    }
    let files = FileSet::read(set, has_points, &mut notes)?;
    if profile == Profile::ShaderLamp && files.distortion.is_none() {
        notes.push(format!(
            "{}:{}: it has no <distortionMap>, which sl wants",
            set.file,
            set.line()
        ));
    }
    Ok(RegionEntry {
        name,
        size_px: needed_size(region)?,
        canvas: read_canvas(buffer, region)?,
        frustum,
        frame,
        files,
        notes,
    })
}

/// A size in pixels from `Xresolution` and `Yresolution`.
fn needed_size(element: Element<'_, '_>) -> Result<[u32; 2], ReadError> {
    let size = |key: &str| -> Result<u32, ReadError> {
        let value = element.needed_attribute(key)?;
        let number = value
            .parse()
            .ok()
            .filter(|size| (1..=MAX_SIZE_PX).contains(size));
        number.ok_or_else(|| {
            element.refuse(key, value, &format!("a whole number of 1…{MAX_SIZE_PX}"))
        })
    };
    Ok([size("Xresolution")?, size("Yresolution")?])
}

fn read_canvas(buffer: Element<'_, '_>, region: Element<'_, '_>) -> Result<CanvasPlace, ReadError> {
    // Shares of the buffer; a region may reach beyond it, but not into nowhere.
    let place = |key| region.number_attribute(key, -100.0..=100.0);
    let extent = |key| region.number_attribute(key, 1e-6..=100.0);
    let (width, height) = (extent("xsize")?, extent("ysize")?);
    let tells_size =
        buffer.attribute("Xresolution").is_some() && buffer.attribute("Yresolution").is_some();
    Ok(CanvasPlace {
        x: place("x")?,
        // From the lower edge upwards to from the upper edge downwards.
        y: 1.0 - (place("y")? + height),
        width,
        height,
        buffer: buffer.attribute("id").unwrap_or("").to_owned(),
        size_px: if tells_size {
            read_buffer_size(buffer)
        } else {
            None
        },
    })
}

/// A canvas may be larger than any output; a size that is none is not told.
fn read_buffer_size(buffer: Element<'_, '_>) -> Option<[u32; 2]> {
    let size = |key: &str| buffer.attribute(key)?.parse().ok().filter(|size| *size > 0);
    Some([size("Xresolution")?, size("Yresolution")?])
}

fn read_frustum(element: Element<'_, '_>) -> Result<Frustum, ReadError> {
    let turn = |key| element.needed_number(key, -360.0..=360.0);
    let edge = |key| element.needed_number(key, -89.999..=89.999);
    let frustum = Frustum {
        yaw_deg: turn("yaw")?,
        pitch_deg: turn("pitch")?,
        roll_deg: turn("roll")?,
        left_deg: edge("leftAngle")?,
        right_deg: edge("rightAngle")?,
        up_deg: edge("upAngle")?,
        down_deg: edge("downAngle")?,
    };
    if frustum.left_deg >= frustum.right_deg {
        let value = frustum.left_deg.to_string();
        return Err(element.refuse(
            "leftAngle",
            &value,
            "less than rightAngle; it is usually negative",
        ));
    }
    if frustum.down_deg >= frustum.up_deg {
        let value = frustum.down_deg.to_string();
        return Err(element.refuse(
            "downAngle",
            &value,
            "less than upAngle; it is usually negative",
        ));
    }
    Ok(frustum)
}

fn read_frame(element: Element<'_, '_>) -> Result<Frame, ReadError> {
    let vector = |name: &str| -> Result<[f64; 3], ReadError> {
        let axis = |end: &str| element.needed_number(&format!("{name}{end}"), -1e6..=1e6);
        Ok([axis("x")?, axis("y")?, axis("z")?])
    };
    let axes = Axes {
        yaw: vector("yaw")?,
        pitch: vector("pitch")?,
        roll: vector("roll")?,
    };
    if !axes.are_orthonormal() {
        let value = format!("{axes:?}");
        return Err(element.refuse("the axes", &value, "three unit vectors at right angles"));
    }
    Ok(Frame {
        position: vector("pos")?,
        axes,
    })
}
