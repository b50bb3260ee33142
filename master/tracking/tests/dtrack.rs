//! DTrack's packets: the manual's lines, what is refused and why, and that nothing stops the reader.

#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

use proptest::prelude::*;
use tracking::dtrack::{LARGEST_PACKET_BYTES, PacketError, parse};
use tracking::sim::{SimBody, SimFlystick, dtrack_packet};

/// Lines as "DTrack2 User's Manual", appendix B.2, shows them, in one packet.
const MANUAL: &str = "fr 21753\r\n\
    ts 39596.024831\r\n\
    6dcal 3\r\n\
    6d 1 [0 1.000][326.848 -187.216 109.503 -160.4704 -3.6963 -7.0913]\
    [-0.940508 -0.339238 -0.019025 0.333599 -0.932599 0.137735 -0.064467 0.123194 0.990286]\r\n\
    6df 1 [0 1.000 2][261.103 116.520 41.085 19.6522 -57.3530 116.5992]\
    [-0.241543 0.968868 -0.054332 -0.482366 -0.168461 -0.859619 -0.842010 -0.181427 0.508039]\r\n\
    6dmtr 1 1 [0 1.000][-485.245 -67.217 -38.328]\
    [0.681257 -0.315034 0.660790 -0.477531 -0.875410 0.074967 0.554845 -0.366620 -0.746817]\r\n\
    6di 2 [0 1 2.135][326.848 -187.216 109.503]\
    [-0.940508 -0.339238 -0.019025 0.333599 -0.932599 0.137735 -0.064467 0.123194 0.990286] \
    [1 0 0.000][0.000 0.000 0.000]\
    [0.000000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000 0.000000]\r\n";

/// Two flysticks, the second hidden with two buttons pressed; the first has 33 buttons.
const FLYSTICKS: &str = "fr 7\r\n\
    6df2 2 2 [0 1.000 33 2][1.000 2.000 3.000][1 0 0 0 1 0 0 0 1][-2147483648 1 -0.50 1.00] \
    [1 -1.000 6 2][0.000 0.000 0.000][0 0 0 0 0 0 0 0 0][9 0.00 0.00]\r\n";

#[test]
fn the_manuals_lines_are_read() {
    let packet = parse(MANUAL.as_bytes()).unwrap();
    assert_eq!(packet.frame, 21_753);
    assert_eq!(packet.stamp_s, Some(39_596.024_831));
    assert_eq!(packet.calibrated, Some(3));
    let [first, inertial, hidden] = &packet.bodies[..] else {
        panic!("{:?}", packet.bodies);
    };
    assert_eq!((first.id, first.tracked), (0, true));
    assert_eq!(first.position_mm, [326.848, -187.216, 109.503]);
    assert_eq!(first.rotation[..3], [-0.940_508, -0.339_238, -0.019_025]);
    assert_eq!(inertial, first);
    assert_eq!((hidden.id, hidden.tracked), (1, false));
    hidden.pose().unwrap_err();
    // The quaternion turns the x axis into the first column.
    let pose = first.pose().unwrap();
    let turned = glam::DQuat::from_array(pose.orientation) * glam::DVec3::X;
    let column = glam::DVec3::new(-0.940_508, -0.339_238, -0.019_025);
    assert!(turned.distance(column) < 1e-5, "{turned}");
    assert_eq!(pose.position, first.position_mm);
    let [flystick] = &packet.flysticks[..] else {
        panic!("{:?}", packet.flysticks);
    };
    assert_eq!(
        flystick.buttons,
        [false, true, false, false, false, false, false, false]
    );
    assert_eq!(flystick.controllers, []);
    assert_eq!(flystick.body.position_mm, [261.103, 116.52, 41.085]);
}

#[test]
fn flysticks_have_buttons_and_controllers() {
    let packet = parse(FLYSTICKS.as_bytes()).unwrap();
    let [first, second] = &packet.flysticks[..] else {
        panic!("{:?}", packet.flysticks);
    };
    assert!(first.body.tracked);
    assert_eq!(first.buttons.len(), 33);
    let pressed: Vec<usize> = (0..33).filter(|button| first.buttons[*button]).collect();
    assert_eq!(pressed, [31, 32]);
    assert_eq!(first.controllers, [-0.5, 1.0]);
    assert!(!second.body.tracked);
    assert_eq!(second.buttons, [true, false, false, true, false, false]);
    assert_eq!(second.controllers, [0.0, 0.0]);
}

#[test]
fn what_the_simulation_writes_is_read() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let body = SimBody {
        id: 4,
        position_mm: [1.0, 1_780.5, -3.25],
        orientation: [0.0, half, 0.0, half],
    };
    let flystick = SimFlystick {
        body: None,
        id: 0,
        buttons: vec![true, false, true],
        controllers: vec![0.25, -1.0],
    };
    let packet = parse(dtrack_packet(9, 12.5, &[body], &[flystick]).as_bytes()).unwrap();
    assert_eq!((packet.frame, packet.stamp_s), (9, Some(12.5)));
    assert_eq!(packet.bodies[0].id, 4);
    // Column by column: x goes to −z.
    assert_eq!(packet.bodies[0].rotation[..3], [0.0, 0.0, -1.0]);
    let pose = packet.bodies[0].pose().unwrap();
    assert_eq!(pose.position, [1.0, 1_780.5, -3.25]);
    for (read, written) in pose.orientation.iter().zip(body.orientation) {
        assert!((read - written).abs() < 1e-6);
    }
    assert!(!packet.flysticks[0].body.tracked);
    assert_eq!(packet.flysticks[0].buttons, [true, false, true]);
    assert_eq!(packet.flysticks[0].controllers, [0.25, -1.0]);
}

#[test]
fn a_packet_without_bodies_is_a_packet() {
    let packet = parse(b"fr 1\n6d 0\n\0").unwrap();
    assert_eq!(packet.bodies, []);
    assert_eq!(packet.stamp_s, None);
}

#[test]
fn rubbish_is_refused_with_its_reason() {
    let refused = |text: &str| parse(text.as_bytes()).unwrap_err();
    let body = "[0 1.0][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1]";
    for text in [
        "",
        "\n",
        "hello",
        "6d 0",
        "frame 1",
        "GET / HTTP/1.1\r\n\r\n",
    ] {
        assert_eq!(refused(text), PacketError::NoFrame, "{text:?}");
    }
    assert_eq!(parse(b"fr 1\n\xff").unwrap_err(), PacketError::NotText(5));
    assert_eq!(parse(b"fr 1\n\0\0").unwrap_err(), PacketError::NotText(5));
    assert!(matches!(
        parse(&vec![b' '; LARGEST_PACKET_BYTES + 1]).unwrap_err(),
        PacketError::TooLong(65_508)
    ));
    for text in [
        "fr".to_owned(),
        "fr x".to_owned(),
        "fr -1".to_owned(),
        "fr 1.5".to_owned(),
        "fr 1\nts nan".to_owned(),
        "fr 1\nts inf".to_owned(),
        "fr 1\nts".to_owned(),
        "fr 1\n6d x".to_owned(),
        "fr 1\n6d 1 [0 1.0][1 2 nan 0 0 0][1 0 0 0 1 0 0 0 1]".to_owned(),
        "fr 1\n6d 1 [0.5 1.0][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1]".to_owned(),
        "fr 1\n6df2 1 1 [0 1 1 0][1 2 3][1 0 0 0 1 0 0 0 1][0.5]".to_owned(),
    ] {
        assert!(
            matches!(refused(&text), PacketError::BadNumber { .. }),
            "{text:?}"
        );
    }
    for text in [
        "fr 1\n6d 1".to_owned(),
        format!("fr 1\n6d 2 {body}"),
        "fr 1\n6d 1 [0 1.0][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1".to_owned(),
        "fr 1\n6d 1 [0 1.0][1 2 3 0 0 0][1 0 0 0 1 0 0 0]".to_owned(),
        "fr 1\n6d 1 [0 1.0][1 2 3 0 0 0][1 0 0 0 1 0 0 0 1 1]".to_owned(),
        "fr 1\n6df2 1 1 [0 1 1 2][1 2 3][1 0 0 0 1 0 0 0 1][1 0]".to_owned(),
    ] {
        assert!(
            matches!(refused(&text), PacketError::BadBlock { .. }),
            "{text:?}"
        );
    }
    for text in [
        "fr 1\n6d 257".to_owned(),
        "fr 1\n6d 4294967295".to_owned(),
        "fr 1\n6df2 1 1 [0 1 65 0]".to_owned(),
        "fr 1\n6df2 1 1 [0 1 1 17]".to_owned(),
    ] {
        assert!(
            matches!(refused(&text), PacketError::TooMany { .. }),
            "{text:?}"
        );
    }
    for text in [
        format!("fr 1\n6d 0 {body}"),
        format!("fr 1\n6d 1 {body} x"),
        "fr 1 2".to_owned(),
    ] {
        assert!(
            matches!(refused(&text), PacketError::Surplus { .. }),
            "{text:?}"
        );
    }
    let named = refused("fr 1\n6d 1 [0 1.0][1 2 oops 0 0 0][1 0 0 0 1 0 0 0 1]").to_string();
    assert_eq!(
        named,
        "line 2 (`6d`): \"oops\" is no number that could stand there"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2_000))]

    #[test]
    fn no_bytes_stop_it(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = parse(&bytes);
    }

    #[test]
    fn no_text_of_its_own_words_stops_it(words in prop::collection::vec(prop::sample::select(vec![
        "fr 1\n", "ts ", "6d ", "6di ", "6df ", "6df2 ", "6dcal ", "[", "]", "[0 1.0]", "[1 2 3]", "[1 2 3 0 0 0]",
        "[1 0 0 0 1 0 0 0 1]", "1 ", "2 ", "-1 ", "1e308 ", "nan ", "\n", "\r\n", " ",
    ]), 0..60)) {
        let text = format!("fr 1\n{}", words.concat());
        if let Ok(packet) = parse(text.as_bytes()) {
            for body in &packet.bodies {
                prop_assert!(body.position_mm.iter().all(|number| number.is_finite()));
                let _ = body.pose();
            }
        }
    }

    #[test]
    fn a_packet_with_a_changed_byte_is_read_or_refused(place in 0..MANUAL.len(), byte: u8) {
        let mut bytes = MANUAL.as_bytes().to_vec();
        bytes[place] = byte;
        if let Ok(packet) = parse(&bytes) {
            for body in &packet.bodies {
                if let Ok(pose) = body.pose() {
                    let length = pose.orientation.iter().map(|part| part * part).sum::<f64>();
                    prop_assert!((length - 1.0).abs() < 1e-9);
                }
            }
        }
    }
}
