//! Archives made to harm: bombs of every kind are stopped while unpacking, by a named error.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{Limits, Options, ReadError, read};
use support::{ALPHA, Description, described, png, read_as, told, warp, zip};

#[test]
fn xml_that_is_none_or_grows_is_refused() {
    for xml in [
        "",
        "hello",
        "<MPCDI>",
        "<MPCDI profile='2d'></mpcdi>",
        "<MPCDI profile=\"&lol;\"/>",
    ] {
        assert!(
            matches!(told(xml), ReadError::Xml { .. }),
            "{xml}: {}",
            told(xml)
        );
    }
    let bomb = "<?xml version=\"1.0\"?><!DOCTYPE lolz [<!ENTITY a \"lol\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;\">\
                <!ENTITY c \"&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;\">]><MPCDI profile=\"2d\">&c;</MPCDI>";
    assert!(matches!(told(bomb), ReadError::XmlDocumentType { .. }));
    let outside =
        "<!DOCTYPE a [<!ENTITY x SYSTEM \"file:///etc/passwd\">]><MPCDI profile=\"2d\">&x;</MPCDI>";
    assert!(matches!(told(outside), ReadError::XmlDocumentType { .. }));
    let not_text = zip(&[("mpcdi.xml", &[0xFF, 0xFE, 0x3C, 0x00][..])]);
    assert!(matches!(
        read_as(&not_text, "a.mpcdi"),
        Err(ReadError::Damaged { .. })
    ));
}

#[test]
fn nesting_does_not_take_the_stack() {
    let deep = format!("{}{}", "<a>".repeat(100_000), "</a>".repeat(100_000));
    let xml = described("2d")
        .xml()
        .replace("</display>", &format!("</display>{deep}"));
    let archive = zip(&[("mpcdi.xml", xml.as_bytes()), ("warp.pfm", &warp())]);
    let small = std::thread::Builder::new().stack_size(256 << 10);
    let outcome = small
        .spawn(move || read_as(&archive, "a.mpcdi").map(|found| found.notes))
        .unwrap()
        .join()
        .unwrap();
    assert!(outcome.unwrap().iter().any(|note| note.contains("<a>")));
}

#[test]
fn many_elements_take_neither_long_nor_many_notes() {
    let many = |count: usize| {
        let unknown: String = (0..count)
            .map(|index| format!("<a{}/>", index % 1000))
            .collect();
        described("2d")
            .xml()
            .replace("</display>", &format!("</display>{unknown}"))
    };
    let archive = |xml: &str| zip(&[("mpcdi.xml", xml.as_bytes()), ("warp.pfm", &warp())]);
    let begun = std::time::Instant::now();
    let notes = read_as(&archive(&many(200_000)), "a.mpcdi").unwrap().notes;
    assert!(notes.len() < 20, "{}", notes.len());
    // It takes milliseconds; telling the line of each would take minutes.
    assert!(begun.elapsed().as_secs() < 20, "{:?}", begun.elapsed());
    assert!(matches!(told(&many(300_000)), ReadError::Xml { .. }));
}

#[test]
fn bombs_are_stopped_while_unpacking() {
    let zeros = vec![0_u8; 32 << 20];
    // A description of spaces, whatever its size is said to be.
    let spaces = vec![b' '; 8 << 20];
    let archive = zip(&[("mpcdi.xml", &spaces)]);
    assert!(archive.len() < 100_000);
    let error = read_as(&archive, "a.mpcdi").unwrap_err();
    assert!(
        matches!(error, ReadError::TooLarge { limit_bytes, .. } if limit_bytes == 4 << 20),
        "{error}"
    );
    // A float map that goes on and on is left after one byte too many.
    let endless = [&warp()[..], &zeros].concat();
    let xml = described("2d").xml();
    let archive = zip(&[("mpcdi.xml", xml.as_bytes()), ("warp.pfm", &endless)]);
    assert!(matches!(
        read_as(&archive, "a.mpcdi"),
        Err(ReadError::Overlong { .. })
    ));
    // A float map that says that it is huge.
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &[b"PF\n16384 16384\n-1\n", &zeros[..]].concat()),
    ]);
    assert!(matches!(
        read_as(&archive, "a.mpcdi"),
        Err(ReadError::TooLarge { .. })
    ));
    // A picture that is none.
    let mut description = described("2d");
    description.files += ALPHA;
    let xml = description.xml();
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &warp()),
        ("a.png", &zeros),
    ]);
    let bounded = |part_bytes, total_bytes| {
        let limits = Limits {
            part_bytes,
            total_bytes,
            ..Limits::default()
        };
        let options = Options {
            limits,
            ..Options::default()
        };
        read(&archive, "a.mpcdi", &options).unwrap_err()
    };
    let error = bounded(1 << 20, 1 << 30);
    assert!(
        matches!(error, ReadError::TooLarge { limit_bytes, .. } if limit_bytes == 1 << 20),
        "{error}"
    );
    let error = bounded(1 << 30, 1 << 20);
    assert!(
        matches!(error, ReadError::TotalTooLarge { limit_bytes, .. } if limit_bytes == 1 << 20),
        "{error}"
    );
}

#[test]
fn a_picture_cannot_promise_more_than_its_bytes_can_hold() {
    // 16384 × 16384 pixels in a few bytes: refused before anything of that size is kept.
    let good = png(
        [2, 2],
        png::ColorType::Grayscale,
        png::BitDepth::Eight,
        &[9; 4],
    );
    let mut liar = good.clone();
    liar[16..24].copy_from_slice(&[0, 0, 0x40, 0, 0, 0, 0x40, 0]);
    let mut crc = png_crc(&liar[12..29]);
    liar[29..33].swap_with_slice(&mut crc);
    let mut description = Description::new("2d", [16_384, 16_384]);
    description.files += ALPHA;
    let xml = description.xml();
    let archive = zip(&[
        ("mpcdi.xml", xml.as_bytes()),
        ("warp.pfm", &warp()),
        ("a.png", &liar),
    ]);
    let error = read_as(&archive, "a.mpcdi").unwrap_err();
    assert!(matches!(error, ReadError::Truncated { .. }), "{error}");
}

/// CRC-32 of PNG (ISO 3309), bit by bit.
fn png_crc(bytes: &[u8]) -> [u8; 4] {
    let mut crc = u32::MAX;
    for byte in bytes {
        crc ^= u32::from(*byte);
        for _ in 0..8 {
            crc = if crc & 1 == 1 {
                (crc >> 1) ^ 0xEDB8_8320
            } else {
                crc >> 1
            };
        }
    }
    (!crc).to_be_bytes()
}
