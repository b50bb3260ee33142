//! Bad input: errors that name the place, bounds, and no panic on any text.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

mod common;

use common::SAMPLES;
use convert::{ConvertError, Format, MAX_TEXT_BYTES, convert};
use proptest::prelude::*;

fn message(text: &str, format: Format) -> String {
    convert(text, "bad.file", format).unwrap_err().to_string()
}

#[test]
fn errors_name_file_line_column_and_what_was_expected() {
    let cases = [
        (
            Format::Qvr,
            "observer a\nwindow b\n",
            "bad.file, line 2, column 1: expected",
        ),
        (
            Format::Sgct,
            "{\n  \"nodes\": [ }",
            "bad.file, line 2, column 14: expected",
        ),
        (
            Format::Equalizer,
            "server\n{ config [ }",
            "bad.file, line 2, column 12: expected a value or \"]\"",
        ),
    ];
    for (format, text, part) in cases {
        let message = message(text, format);
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn wrong_values_are_refused_with_their_place() {
    let change = |sample: &str, from: &str, to: &str| {
        let (name, text, format) = SAMPLES.into_iter().find(|(n, ..)| *n == sample).unwrap();
        assert!(text.contains(from));
        convert(&text.replace(from, to), name, format)
            .unwrap_err()
            .to_string()
    };
    let cases = [
        (
            change("desk.qvr", "size 1280 720", "size 1280 0"),
            "line 13 (process main › window front › size): expected whole numbers within 1…16384, found \"1280 0\"",
        ),
        (
            change(
                "desk.qvr",
                "observer me\n        output",
                "observer you\n        output",
            ),
            "the name of an observer",
        ),
        (
            change("desk.json", "1280", "12.5"),
            "nodes[0].windows[0].size.x: expected a whole number",
        ),
        (change("desk.json", "2.0,", "-2.0,"), "a distance above 0"),
        (
            change("desk.json", "80.0", "\"80\""),
            "fov.hfov: expected a number",
        ),
        (
            change("desk.eqc", "[ -.8 -.5 -1 ]", "[ -.8 -.5 ]"),
            "expected 3 numbers",
        ),
        (
            change(
                "desk.eqc",
                "segment { channel \"channel\"",
                "segment { channel \"c\"",
            ),
            "the name of a channel",
        ),
        (change("desk.eqc", "1280 800", "1280 8e99"), "in pixels"),
    ];
    for (message, part) in cases {
        assert!(message.contains(part), "{message}");
    }
}

#[test]
fn sizes_are_bounded() {
    let long = " ".repeat(MAX_TEXT_BYTES + 1);
    for (_, _, format) in SAMPLES {
        assert!(matches!(
            convert(&long, "x", format),
            Err(ConvertError::TooLong { .. })
        ));
    }
    let mut hosts = "observer o\n".to_owned();
    for index in 0..300 {
        hosts.push_str(&format!(
            "process p{index}\nwindow w{index}\nobserver o\nscreen_is_given_by_center false\nscreen_wall 0 0 -{index}.5 4 0 -{index}.5 0 3 -{index}.5\n"
        ));
    }
    let message = message(&hosts, Format::Qvr);
    assert!(message.contains("more than 256"), "{message}");
    let keys = format!("observer o\n{}", "k 1\n".repeat(100_000));
    let message = convert(&keys, "x", Format::Qvr).unwrap_err().to_string();
    assert!(message.contains("more than 65536 keys"), "{message}");
    for (format, open) in [(Format::Sgct, "{\"a\":["), (Format::Equalizer, "a{")] {
        let deep = open.repeat(50_000);
        assert!(matches!(
            convert(&deep, "x", format),
            Err(ConvertError::Syntax { .. })
        ));
    }
}

#[test]
fn a_source_without_pictures_says_why() {
    let cases = [
        (
            Format::Qvr,
            "observer o\nprocess p\nwindow w\nobserver o\noutput oculus\n",
            "head-mounted",
        ),
        (Format::Qvr, "", "no window of it"),
        (Format::Sgct, "{}", "no window of it"),
        (
            Format::Equalizer,
            "server { config { appNode { } } }",
            "no window of it",
        ),
    ];
    for (format, text, part) in cases {
        match convert(text, "empty", format) {
            Err(error @ ConvertError::NothingLeft { .. }) => {
                let ConvertError::NothingLeft { lost, .. } = &error else {
                    unreachable!()
                };
                let all = format!("{error} {lost:?}");
                assert!(all.contains(part), "{all}");
            }
            other => panic!("{other:?}"),
        }
    }
}

#[test]
fn formats_are_known_by_their_extensions() {
    for (name, _, format) in SAMPLES {
        assert_eq!(Format::of_file_name(name), Some(format));
    }
    assert_eq!(Format::of_file_name("a/B.EQC"), Some(Format::Equalizer));
    assert_eq!(Format::of_file_name("wall.toml"), None);
    assert_eq!(Format::of_file_name("json"), None);
}

/// A result is a file that can be read again, whose names are as long as names may be.
fn check(text: &str, format: Format) {
    if let Ok(converted) = convert(text, "mutated.x", format) {
        let document: toml_edit::DocumentMut = converted.toml.parse().unwrap();
        assert!(document.get("hosts").is_some());
    }
}

const PIECES: [&str; 24] = [
    "{",
    "}",
    "[",
    "]",
    "(",
    ")",
    "\"",
    "'",
    "#",
    "\n",
    " ",
    "-1",
    "0",
    "1e308",
    "-1e-308",
    "NaN",
    "99999999999999999999",
    "\u{0}",
    "ä€",
    "window w\n",
    "process p\n",
    "null,",
    "wall {",
    "é\r\n",
];

proptest! {
    #![proptest_config(ProptestConfig::with_cases(600))]

    #[test]
    fn mutated_samples_never_panic(
        sample in 0..SAMPLES.len(),
        changes in prop::collection::vec((any::<prop::sample::Index>(), 0..PIECES.len(), 0_usize..40, any::<bool>()), 1..6),
    ) {
        let (_, text, format) = SAMPLES[sample];
        let mut characters: Vec<char> = text.chars().collect();
        for (at, piece, cut, doubles) in changes {
            let at = at.index(characters.len() + 1);
            let end = (at + cut).min(characters.len());
            let middle: Vec<char> = match doubles {
                true => characters[at..end].iter().chain(&characters[at..end]).copied().collect(),
                false => PIECES[piece].chars().collect(),
            };
            characters.splice(at..end, middle);
        }
        let text: String = characters.into_iter().collect();
        check(&text, format);
    }

    #[test]
    fn numbers_of_any_size_never_panic(
        sample in 0..SAMPLES.len(),
        which in any::<prop::sample::Index>(),
        number in prop::sample::select(vec!["0", "-0", "-1", "1e-300", "0.000001", "999", "65536", "1e15", "-1e15", "1e300", "9223372036854775807", "0.5", "360", "180", "90"]),
    ) {
        let (_, text, format) = SAMPLES[sample];
        let mut places = Vec::new();
        let mut start = None;
        for (at, c) in text.char_indices().chain([(text.len(), ' ')]) {
            let is_part = c.is_ascii_digit() || ".-".contains(c);
            match (is_part, start) {
                (true, None) => start = Some(at),
                (false, Some(from)) => { places.push((from, at)); start = None; }
                _ => {}
            }
        }
        let (from, to) = places[which.index(places.len())];
        check(&format!("{}{number}{}", &text[..from], &text[to..]), format);
    }

    #[test]
    fn any_text_never_panics(text in any::<String>(), format in prop::sample::select(vec![Format::Qvr, Format::Sgct, Format::Equalizer])) {
        check(&text, format);
    }
}
