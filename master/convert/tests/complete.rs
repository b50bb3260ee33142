//! Nothing is dropped silently: whatever changes in a source changes the file, the list, or is an error.
//! Every word and number of every sample, and every line, is changed in turn.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::indexing_slicing,
    reason = "a test that panics has failed"
)]

mod common;

use common::SAMPLES;
use convert::{Format, convert};

/// Where words and numbers stand, comments left out.
fn words(text: &str, format: Format) -> Vec<(usize, usize)> {
    let bytes = text.as_bytes();
    let is_part = |b: u8| b.is_ascii_alphanumeric() || b"_.+-".contains(&b);
    let comments = format != Format::Sgct;
    let mut found = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let starts_comment = bytes[at] == b'#' || bytes[at..].starts_with(b"//");
        if comments && starts_comment {
            while at < bytes.len() && bytes[at] != b'\n' {
                at += 1;
            }
        } else if is_part(bytes[at]) {
            let start = at;
            while at < bytes.len() && is_part(bytes[at]) {
                at += 1;
            }
            found.push((start, at));
        } else {
            at += 1;
        }
    }
    found
}

/// Words that may change without effect: "up" may lean towards where the head looks, and be of any length.
const FREE: [&str; 2] = ["cave.qvr, line 14: 0", "cave.qvr, line 14: 1"];

fn changed(word: &str) -> String {
    match word.parse::<f64>() {
        Ok(number) if number.fract() == 0.0 && !word.contains('.') => (number + 1.0).to_string(),
        Ok(number) => format!("{:.4}", number + 0.25),
        Err(_) => format!("zz{word}"),
    }
}

#[test]
fn every_word_of_every_sample_counts() {
    let mut count = 0;
    let mut idle = Vec::new();
    for (name, text, format) in SAMPLES {
        let before = convert(text, name, format).unwrap();
        for (start, end) in words(text, format) {
            let word = &text[start..end];
            let other = format!("{}{}{}", &text[..start], changed(word), &text[end..]);
            let after = convert(&other, name, format);
            let line = text[..start].lines().count();
            if after.as_ref() == Ok(&before) {
                idle.push(format!("{name}, line {line}: {word}"));
            }
            count += 1;
        }
    }
    assert!(count > 1000, "{count}");
    assert_eq!(idle, FREE, "without influence");
}

/// Every key that is listed names its place, a reason and a remedy, and the file's head says all of it.
#[test]
fn the_head_of_the_file_says_what_the_list_says() {
    for (name, text, format) in SAMPLES {
        let converted = convert(text, name, format).unwrap();
        let comments: Vec<&str> = converted
            .toml
            .lines()
            .take_while(|line| line.starts_with('#'))
            .flat_map(|line| line.trim_start_matches('#').split_whitespace())
            .collect();
        let head = comments.join(" ");
        for lost in &converted.lost {
            for part in [&lost.place, &lost.what, &lost.why, &lost.remedy] {
                assert!(!part.trim().is_empty(), "{name}: {lost:?}");
                let part: Vec<&str> = part.split_whitespace().collect();
                assert!(head.contains(&part.join(" ")), "{name}: {part:?}");
            }
        }
    }
}

#[test]
fn unknown_keys_are_listed_wherever_they_stand() {
    let cases = [
        (
            "desk.qvr",
            "        size 1280",
            "        odd_key 5\n        size 1280",
            "odd_key 5",
        ),
        (
            "desk.qvr",
            "    eye_distance",
            "    odd_key a b\n    eye_distance",
            "odd_key a b",
        ),
        (
            "desk.json",
            "\"version\"",
            "\"odd\": { \"key\": [1, {}] }, \"version\"",
            "odd { key",
        ),
        (
            "desk.json",
            "\"fullscreen\"",
            "\"odd\": null, \"fullscreen\"",
            "nodes[0].windows[0].odd",
        ),
        (
            "desk.eqc",
            "layout 0",
            "layout 0 odd { key [ 1 2 ] }",
            "odd { key 1 2 }",
        ),
        ("desk.eqc", "segment {", "segment { odd ON", "odd ON"),
    ];
    for (sample, from, to, listed) in cases {
        let (name, text, format) = SAMPLES.into_iter().find(|(n, ..)| *n == sample).unwrap();
        let converted = convert(&text.replace(from, to), name, format).unwrap();
        let found = converted
            .lost
            .iter()
            .any(|lost| lost.to_string().contains(listed));
        assert!(found, "{sample}: {listed}: {:#?}", converted.lost);
    }
}

#[test]
fn of_repeated_keys_the_last_holds_and_the_others_are_listed() {
    let cases = [
        (
            "desk.qvr",
            "size 1280 720",
            "size 640 480\n size 1280 720",
            "size 640 480",
        ),
        (
            "desk.json",
            "\"fullscreen\": false",
            "\"fullscreen\": true, \"fullscreen\": false",
            "fullscreen true",
        ),
        (
            "desk.eqc",
            "viewport [ 100",
            "viewport [ 7 7 9 9 ] viewport [ 100",
            "viewport 7 7 9 9",
        ),
    ];
    for (sample, from, to, listed) in cases {
        let (name, text, format) = SAMPLES.into_iter().find(|(n, ..)| *n == sample).unwrap();
        let before = convert(text, name, format).unwrap();
        let after = convert(&text.replace(from, to), name, format).unwrap();
        assert_eq!(after.lost.len(), before.lost.len() + 1, "{sample}");
        let lost = after
            .lost
            .iter()
            .find(|lost| lost.what.contains(listed))
            .unwrap();
        assert!(lost.why.contains("the last one holds"), "{lost}");
    }
}
