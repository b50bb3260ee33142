//! `terrawall set LAYER.PARAM=VALUE…`: changes the scene of a running wall.
//!
//! In: assignments, where the control API listens. Out: the number of the new revision. All assignments are one
//! request: the wall takes all of them or none.

use protocol::Scene;
use serde_json::{Value, json};

use crate::args::Set;
use crate::failure::{Failure, OrConfiguration as _};
use crate::output;

use super::client::{Client, Method};

/// Changes the scene.
pub(crate) fn run(args: &Set) -> Result<(), Failure> {
    let assignments = args.assignments.iter().map(String::as_str);
    let patch = Scene::assignments(assignments).or_configuration()?;
    let client = Client::new(&args.master)?;
    let answer = client.ask(Method::Patch, "/api/scene", &patch)?;
    let revision = answer.get("revision").and_then(Value::as_u64);
    let revision = revision.ok_or_else(|| client.not_ours("it told no revision"))?;
    if args.json {
        output::json(&json!({ "revision": revision }))
    } else {
        output::line(format!("revision {revision}"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

    use super::*;
    use crate::args::RunningMaster;
    use crate::failure::{FAILED, USAGE};

    #[test]
    fn wrong_words_and_absent_masters_are_told_apart() {
        let set = |control: &str, assignment: &str| {
            run(&Set {
                assignments: vec![assignment.to_owned()],
                master: RunningMaster {
                    control: control.to_owned(),
                    token_file: None,
                },
                json: false,
            })
            .unwrap_err()
        };
        let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let nobody = free.local_addr().unwrap().to_string();
        drop(free);
        for (control, assignment, code, words) in [
            (&*nobody, "relief.scale", USAGE, "relief.scale"),
            (&*nobody, "relief.scale=2", FAILED, &*nobody),
            ("localhost", "relief.scale=2", USAGE, "HOST:PORT"),
            ("a b:1", "relief.scale=2", USAGE, "HOST:PORT"),
        ] {
            let failure = set(control, assignment);
            assert_eq!(failure.exit_code(), code, "{failure}");
            assert!(failure.to_string().contains(words), "{failure}");
        }
    }
}
