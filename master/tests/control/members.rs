//! A node that speaks the protocol by hand, where what nodes hear or say of scenes matters.
//! In: a running master. Out: verdicts on what the node hears and what clients read. It draws nothing.

use std::time::{Duration, Instant};

use link::{Identity, MessageReceiver, MessageSender, Peer};
use master::Notice;
use protocol::codec::{decode_to_node, encode_to_master};
use protocol::message::{Hello, MoveLens};
use protocol::{PROTOCOL_VERSION, Scene, ToMaster, ToNode};
use serde_json::{Value, json};

use super::http::{get, patch};
use super::{Running, start};

/// A node that speaks by hand.
struct Member {
    sender: MessageSender,
    receiver: MessageReceiver,
    _peer: Peer,
}

impl Member {
    async fn join(running: &Running) -> Self {
        let identity = Identity::load(running.folder.path()).unwrap();
        let address = running.master.address().to_string();
        let peer = link::connect(&address, &identity).await.unwrap();
        let (sender, receiver) = peer.accept_control(1 << 20, 1 << 20).await.unwrap();
        let mut member = Self {
            sender,
            receiver,
            _peer: peer,
        };
        let ToNode::Challenge { session, .. } = member.hear().await else {
            panic!("no challenge")
        };
        let hello = Hello {
            protocol_version: PROTOCOL_VERSION,
            program_version: "test".to_owned(),
            session,
            node: "west".to_owned(),
            adapter: "none".to_owned(),
            process_id: 1,
        };
        member.say(&ToMaster::Hello(hello)).await;
        let welcome = member.hear().await;
        assert!(
            matches!(welcome, ToNode::Welcome { host: 0, .. }),
            "{welcome:?}"
        );
        member
    }

    async fn hear(&mut self) -> ToNode {
        let patience = Duration::from_secs(10);
        let heard = tokio::time::timeout(patience, self.receiver.receive()).await;
        decode_to_node(&heard.expect("the master says something").unwrap()).unwrap()
    }

    /// The next scene.
    async fn scene(&mut self) -> (u64, Scene) {
        loop {
            if let ToNode::Scene { revision, scene } = self.hear().await {
                return (revision, *scene);
            }
        }
    }

    async fn say(&mut self, message: &ToMaster) {
        let bytes = encode_to_master(message).unwrap();
        self.sender.send(&bytes).await.unwrap();
    }

    async fn drag(&mut self, latitude_deg: f64, longitude_deg: f64, grab: bool) {
        let place = MoveLens {
            latitude_deg,
            longitude_deg,
            grab,
        };
        self.say(&ToMaster::MoveLens(place)).await;
    }
}

fn block_on(future: impl Future<Output = ()>) {
    // The connection lives on a worker, whatever a test waits for.
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(1)
        .enable_all()
        .build();
    runtime.unwrap().block_on(future);
}

#[test]
fn a_dragged_lens_moves_for_nodes_and_clients() {
    let running = start();
    let second = json!({ "lenses": { "far": { "latitude_deg": -45.0, "longitude_deg": -170.0, "radius_m": 1e5 } } });
    assert_eq!(patch(running.address, &second).revision(), 2);
    block_on(async {
        let mut member = Member::join(&running).await;
        let (revision, before) = member.scene().await;
        assert_eq!(revision, 2);
        let centre = |scene: &Scene, name: &str| {
            let lens = scene.lenses.iter().find(|lens| lens.name == name).unwrap();
            [lens.latitude_deg, lens.longitude_deg]
        };
        // Within the loupe's circle: that one follows, over the other one's ground too.
        member.drag(45.9, 6.9, true).await;
        let (revision, scene) = member.scene().await;
        assert_eq!((revision, centre(&scene, "loupe")), (3, [45.9, 6.9]));
        member.drag(-45.0, -170.0, false).await;
        assert_eq!(centre(&member.scene().await.1, "loupe"), [-45.0, -170.0]);
        assert_eq!(
            get(running.address).body["scene"]["lenses"]["loupe"]["longitude_deg"],
            json!(-170.0)
        );
        // A place where it is already is no change.
        member.drag(-45.0, -170.0, false).await;
        member.drag(45.8, 6.9, false).await;
        let (revision, scene) = member.scene().await;
        assert_eq!(revision, 5);
        // Beside all: the nearest.
        member.drag(-44.0, 179.0, true).await;
        let (_, moved) = member.scene().await;
        let lenses = [&scene, &moved].map(|scene| ["far", "loupe"].map(|name| centre(scene, name)));
        assert_eq!(
            lenses[0]
                .iter()
                .zip(&lenses[1])
                .filter(|(a, b)| a != b)
                .count(),
            1
        );
        assert_eq!(moved.layers, before.layers);
        // The lens that is held may be taken away.
        let none = json!({ "lenses": { "far": null, "loupe": null } });
        let revision = patch(running.address, &none).revision();
        assert_eq!(member.scene().await.0, revision);
        member.drag(0.0, 0.0, false).await;
        member.drag(0.0, 0.0, true).await;
        assert_eq!(patch(running.address, &json!({})).revision(), revision);
    });
}

#[test]
fn what_nodes_say_of_revisions_that_nobody_asked_for_changes_nothing() {
    let running = start();
    block_on(async {
        let mut member = Member::join(&running).await;
        assert_eq!(member.scene().await.0, 1);
        for revision in [0, 2, u64::MAX] {
            member.say(&ToMaster::Prepared { revision }).await;
            member.say(&ToMaster::cannot_prepare(revision, "no")).await;
        }
        member
            .say(&ToMaster::cannot_prepare(
                1,
                "layer \"relief\": no repository",
            ))
            .await;
        let deadline = Instant::now() + Duration::from_secs(10);
        loop {
            assert!(
                Instant::now() < deadline,
                "the operator does not hear of it"
            );
            match running.master.next_notice(Duration::from_millis(50)) {
                Some(Notice::Fault { node, message }) => {
                    assert!(
                        node == "west" && message.contains("no repository"),
                        "{message}"
                    );
                    break;
                }
                Some(Notice::ChangeRefused { .. }) => panic!("nothing was changed"),
                _ => {}
            }
        }
        let scene = get(running.address);
        assert_eq!(
            (scene.revision(), &scene.body["refused"]),
            (1, &Value::Null)
        );
    });
}
