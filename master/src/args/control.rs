//! The command line of the control API: where `up` and `master` open it, and what `set` asks of it.
//!
//! In: the arguments of the process. Out: [`Control`], [`Set`], [`Adjust`], [`ShowPattern`]. Token files are read by the commands.

use std::net::SocketAddr;
use std::path::PathBuf;

use clap::Args as ArgumentGroup;
use protocol::pattern::Pattern;

/// What both `up` and `master` take of the control API.
#[derive(Debug, ArgumentGroup)]
#[command(next_help_heading = "Control API")]
pub(crate) struct Control {
    /// Address and TCP port at which the running scene can be read and changed over HTTP
    /// (GET and PATCH /api/scene; see `terrawall set`). An address that other hosts reach needs a token
    /// [default: 127.0.0.1:4680, or a free port where that one is taken]
    #[arg(long, value_name = "ADDRESS:PORT")]
    pub(crate) control: Option<SocketAddr>,
    /// File with the token that every request must bear: one word, readable by you alone
    #[arg(long, value_name = "FILE")]
    pub(crate) control_token_file: Option<PathBuf>,
    /// Let nobody read or change the running scene
    #[arg(long, conflicts_with_all = ["control", "control_token_file"])]
    pub(crate) no_control: bool,
}

/// The running master that a command talks to.
#[derive(Debug, ArgumentGroup)]
pub(crate) struct RunningMaster {
    /// Where the running master's control API listens, as it said at its start
    #[arg(long, value_name = "HOST:PORT", default_value_t = master::DEFAULT_CONTROL_ADDRESS.to_string())]
    pub(crate) control: String,
    /// File with the token of the control API, if it has one
    #[arg(long, value_name = "FILE")]
    pub(crate) token_file: Option<PathBuf>,
}

/// What a glance at `terrawall set --help` should teach.
const EXAMPLES: &str = "\
All assignments become one change, which every node shows from the same frame on, or none does. The command prints
the number of the new revision; a change that changes nothing makes none. What is there to be set:
curl http://127.0.0.1:4680/api/scene

Examples:
  terrawall set relief.scale=2
  terrawall set sar.mapping=gamma sar.exponent=0.5 photo.opacity=0.8
  terrawall set heights.ramp=hypsometric lines.colour=[1,0.8,0]
  terrawall set lenses.loupe.radius_m=20000 lenses.loupe.layers.relief.scale=3
  terrawall set lenses.loupe=null light.sun=camera";

/// `terrawall set`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Set {
    /// What is to be what: LAYER.PARAMETER=VALUE, or the path of any other value of the scene file, for
    /// example light.ambient=0.3. VALUE is JSON (2, [0,1], null) or else a text; null takes the key away,
    /// which gives the default back or removes a layer or lens
    #[arg(required = true, value_name = "LAYER.PARAM=VALUE")]
    pub(crate) assignments: Vec<String>,
    /// Which master.
    #[command(flatten)]
    pub(crate) master: RunningMaster,
    /// Print the answer as JSON
    #[arg(long)]
    pub(crate) json: bool,
}

/// What a glance at `terrawall adjust --help` should teach.
const ADJUSTMENTS: &str = "\
All assignments become one change, which every node shows from the same frame on, or none does. What is there:
curl http://127.0.0.1:4680/api/wall

Examples:
  terrawall adjust observers.viewer.head_m=[0,1.72,3] observers.viewer.eye_separation_m=0.061
  terrawall adjust screens.front.corners_m.top_left=[-2.01,2.75,0]
  terrawall adjust screens.dome.tilt_deg=21.5 outputs.left/projector.gamma=2.3
  terrawall adjust outputs.left/projector.channels.0.blend_gamma=1.2
  terrawall adjust --save";

/// `terrawall adjust`
#[derive(Debug, ArgumentGroup)]
#[command(after_help = ADJUSTMENTS)]
pub(crate) struct Adjust {
    /// What is to be what: observers.NAME.KEY=VALUE, screens.NAME.KEY=VALUE or outputs.HOST/OUTPUT.KEY=VALUE; VALUE is JSON
    #[arg(value_name = "THING.KEY=VALUE")]
    pub(crate) assignments: Vec<String>,
    /// Write the wall file with all changes so far; its comments stay
    #[arg(long)]
    pub(crate) save: bool,
    /// Which master.
    #[command(flatten)]
    pub(crate) master: RunningMaster,
}

/// `terrawall pattern`
#[derive(Debug, ArgumentGroup)]
pub(crate) struct ShowPattern {
    /// grid, colour-bars, blend-ramp, focus-star, identify, or off for the scene
    #[arg(value_name = "PATTERN", value_parser = pattern_or_off)]
    pub(crate) pattern: PatternOrOff,
    /// Only on these outputs; without any, on all of them
    #[arg(value_name = "HOST/OUTPUT")]
    pub(crate) outputs: Vec<String>,
    /// Which master.
    #[command(flatten)]
    pub(crate) master: RunningMaster,
}

/// A pattern, or none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct PatternOrOff(pub(crate) Option<Pattern>);

fn pattern_or_off(text: &str) -> Result<PatternOrOff, String> {
    if text == "off" {
        return Ok(PatternOrOff(None));
    }
    let found = Pattern::from_name(text);
    found
        .map(|pattern| PatternOrOff(Some(pattern)))
        .ok_or_else(|| {
            let names = Pattern::NAMES.map(|(_, name)| name);
            format!("write off or one of {}", names.join(", "))
        })
}
