//! The control API as commands set it up: options from arguments, tokens from files.
//!
//! In: arguments. Out: options of the master, or a failure of configuration. It must not show a token.

use std::path::Path;

use anyhow::Context as _;
use master::{ControlOptions, DEFAULT_CONTROL_ADDRESS, Master, MasterOptions, WallFile};

use crate::args::Control;
use crate::failure::{Failure, OrConfiguration as _};

/// Where `up` and `master` open the control API, and how strictly.
#[derive(Clone, Default)]
pub(crate) struct Opening {
    options: Option<ControlOptions>,
    any_port: bool,
}

impl Opening {
    /// From arguments.
    pub(crate) fn new(args: &Control) -> Result<Self, Failure> {
        if args.no_control {
            return Ok(Self::default());
        }
        let options = ControlOptions {
            bind: args.control.unwrap_or(DEFAULT_CONTROL_ADDRESS),
            token: args.control_token_file.as_deref().map(token).transpose()?,
        };
        options.check().or_configuration()?;
        Ok(Self {
            options: Some(options),
            // An operator who has named a port finds the API there or not at all.
            any_port: args.control.is_none(),
        })
    }

    /// Puts it into a master's options. `scene` is the scene file, whose directory relative repositories are taken
    /// from.
    pub(crate) fn put_into(
        &self,
        options: &mut MasterOptions,
        scene: &Path,
        wall: Option<WallFile>,
    ) -> Result<(), Failure> {
        options.wall_file = wall;
        let scene = std::path::absolute(scene)
            .with_context(|| format!("cannot resolve {}", scene.display()))?;
        options.scene_directory = scene.parent().map(Path::to_owned);
        options.control.clone_from(&self.options);
        options.any_control_port = self.any_port;
        Ok(())
    }

    /// Says where the control API of a started master is.
    pub(crate) fn announce(&self, master: &Master) {
        let Some(address) = master.control_address() else {
            return;
        };
        let asked = self.options.as_ref().map(|options| options.bind);
        if let Some(asked) = asked.filter(|asked| self.any_port && *asked != address) {
            eprintln!(
                "terrawall: {asked} is taken: the control API has another port, which terrawall set must be told with \
                 --control {address}"
            );
        }
        eprintln!("terrawall: the scene can be read and changed at http://{address}/api/scene");
    }
}

/// Reads a token file. The token is its one word.
pub(crate) fn token(path: &Path) -> Result<String, Failure> {
    let text = std::fs::read_to_string(path)
        .with_context(|| format!("cannot read the token file {}", path.display()))
        .or_configuration()?;
    let token = text.trim();
    let good = !token.is_empty() && token.bytes().all(|byte| byte.is_ascii_graphic());
    if !good {
        return Err(Failure::configuration(format!(
            "{} must hold one word of visible ASCII characters and nothing else, for example the output of: \
             openssl rand -hex 32",
            path.display()
        )));
    }
    Ok(token.to_owned())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;
    use crate::failure::USAGE;

    fn control(address: Option<&str>, token_file: Option<&Path>) -> Control {
        Control {
            control: address.map(|address| address.parse().unwrap()),
            control_token_file: token_file.map(Path::to_owned),
            no_control: false,
        }
    }

    #[test]
    fn the_default_is_loopback_and_gives_way() {
        let opening = Opening::new(&control(None, None)).unwrap();
        assert!(opening.any_port);
        assert_eq!(opening.options.unwrap().bind, DEFAULT_CONTROL_ADDRESS);
        let named = Opening::new(&control(Some("127.0.0.1:9"), None)).unwrap();
        assert!(!named.any_port);
        let none = Control {
            no_control: true,
            ..control(None, None)
        };
        assert!(Opening::new(&none).unwrap().options.is_none());
    }

    #[test]
    fn other_addresses_need_a_token() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("token");
        let open = |file: Option<&Path>| Opening::new(&control(Some("0.0.0.0:4680"), file));
        let Err(failure) = open(None) else {
            panic!("it must not be open to everyone")
        };
        assert_eq!(failure.exit_code(), USAGE);
        assert!(
            failure.to_string().contains("--control-token-file"),
            "{failure}"
        );
        std::fs::write(&file, "secret\n").unwrap();
        let options = open(Some(&file)).unwrap().options.unwrap();
        assert_eq!(options.token.as_deref(), Some("secret"));
        for bad in ["", "\n", "two words", "schlüssel"] {
            std::fs::write(&file, bad).unwrap();
            assert_eq!(
                open(Some(&file)).err().unwrap().exit_code(),
                USAGE,
                "{bad:?}"
            );
        }
        std::fs::remove_file(&file).unwrap();
        assert!(
            open(Some(&file))
                .err()
                .unwrap()
                .to_string()
                .contains("token")
        );
    }
}
