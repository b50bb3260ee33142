//! Valid files of every format, cut and flipped at random: no panic, and memory stays within bounds.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

mod support;

use calibration::{Calibration, Format, Options, PfmMeaning, mpcdi, read};
use proptest::prelude::*;
use support::{Bitmap, Description, FRUSTUM, WarpMap, pfm, zip};

/// How much more memory all of these readings may ever take.
const BOUND_KIB: u64 = 1 << 20;

#[derive(Clone, Debug)]
enum Damage {
    Cut(usize),
    Flip(usize, u8),
    Remove(usize, usize),
    Repeat(usize, usize),
}

fn damages() -> impl Strategy<Value = Vec<Damage>> {
    let one = prop_oneof![
        any::<usize>().prop_map(Damage::Cut),
        (any::<usize>(), 0_u8..8).prop_map(|(place, bit)| Damage::Flip(place, bit)),
        (any::<usize>(), 1_usize..40).prop_map(|(place, length)| Damage::Remove(place, length)),
        (any::<usize>(), 1_usize..40).prop_map(|(place, length)| Damage::Repeat(place, length)),
    ];
    prop::collection::vec(one, 1..6)
}

/// Three of four places lie in the first 600 bytes, where headers are.
fn place(any: usize, length: usize) -> usize {
    let reach = if any.is_multiple_of(4) {
        length
    } else {
        length.min(600)
    };
    any / 4 % reach.max(1)
}

fn damaged(bytes: &[u8], damages: &[Damage]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for damage in damages {
        let length = bytes.len();
        match *damage {
            Damage::Cut(at) => bytes.truncate(place(at, length)),
            Damage::Flip(at, bit) => {
                if let Some(byte) = bytes.get_mut(place(at, length)) {
                    *byte ^= 1 << bit;
                }
            }
            Damage::Remove(at, count) => {
                let at = place(at, length);
                bytes.drain(at..(at + count).min(length));
            }
            Damage::Repeat(at, count) => {
                let at = place(at, length);
                let again = bytes[at..(at + count).min(length)].to_vec();
                bytes.splice(at..at, again);
            }
        }
    }
    bytes
}

fn lamp() -> [(&'static str, Vec<u8>); 4] {
    let mut description = Description::new("sl", [8, 4]);
    description.inside_region = format!(
        "{FRUSTUM}<coordinateFrame><posx>0</posx><posy>0</posy><posz>0</posz><yawx>0</yawx><yawy>-1</yawy><yawz>0</yawz>\
         <pitchx>1</pitchx><pitchy>0</pitchy><pitchz>0</pitchz><rollx>0</rollx><rolly>0</rolly><rollz>-1</rollz></coordinateFrame>"
    );
    description.files += "<alphaMap><path>a.png</path><bitDepth>8</bitDepth></alphaMap>\
                          <distortionMap><path>lens.pfm</path></distortionMap>";
    let warp = pfm(8, &[[0.5, 0.25, 0.75]; 32], true);
    let alpha = support::png(
        [8, 4],
        png::ColorType::Grayscale,
        png::BitDepth::Eight,
        &[128; 32],
    );
    [
        ("mpcdi.xml", description.xml().into_bytes()),
        ("warp.pfm", warp.clone()),
        ("lens.pfm", warp),
        ("a.png", alpha),
    ]
}

fn pack(parts: &[(&'static str, Vec<u8>)]) -> Vec<u8> {
    let parts: Vec<(&str, &[u8])> = parts
        .iter()
        .map(|(name, bytes)| (*name, bytes.as_slice()))
        .collect();
    zip(&parts)
}

/// A valid file of every format.
fn files() -> Vec<(Format, Vec<u8>)> {
    let records = support::even(8, 4)
        .iter()
        .map(|[u, v]| [*u, *v, 1.0, 0.0])
        .collect();
    let picture = Bitmap {
        bits: 24,
        top_down: false,
        size: [8, 4],
        pixels: vec![77; 96],
    };
    let vwf = support::vwf_set(&[
        WarpMap::new("a", [8, 4], records).bytes(),
        picture.bytes(),
        picture.bytes(),
    ]);
    let obj = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3 4/4\nf -4/1 -2/2 -1/3\n";
    let dome = "x;y;u;v;c;r\n0;0;0;0;0;0\n1;0;1;0;1;0\n0;1;0;1;0;1\n1;1;1;1;1;1\n";
    let bourke = "2\n2 2\n-2 -1 0 0 1\n2 -1 1 0 .5\n-2 1 0 1 1\n2 1 1 1 0\n";
    vec![
        (Format::Mpcdi, pack(&lamp())),
        (Format::Vwf, vwf),
        (Format::Pfm, pfm(8, &[[0.5, 0.25, 0.75]; 32], false)),
        (Format::Obj, obj.as_bytes().to_vec()),
        (Format::Domeprojection, dome.as_bytes().to_vec()),
        (Format::Bourke, bourke.as_bytes().to_vec()),
    ]
}

fn options(format: Option<Format>) -> Options {
    Options {
        format,
        size_px: Some([64, 32]),
        pfm: PfmMeaning::Canvas,
        ..Options::default()
    }
}

/// Whatever is read must hold what it says.
fn check(calibration: &Calibration) {
    for region in &calibration.regions {
        let [width, height] = region.size_px;
        assert!((1..=16_384).contains(&width) && (1..=16_384).contains(&height));
        for map in [&region.alpha, &region.beta].into_iter().flatten() {
            let value = map.sample(0.5, 0.5).unwrap();
            assert!(value.iter().all(|value| (0.0..=1.0).contains(value)));
        }
    }
    // What can be written can be read.
    if let Ok(bytes) = mpcdi::write(calibration) {
        assert!(read(&bytes, "again.mpcdi", &Options::default()).is_ok());
    }
}

#[cfg(target_os = "linux")]
fn peak_kib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status
        .lines()
        .find(|line| line.starts_with("VmPeak:"))
        .unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// Elsewhere only panics count.
#[cfg(not(target_os = "linux"))]
fn peak_kib() -> u64 {
    0
}

/// One test, so that nothing else of this process takes memory meanwhile.
#[test]
fn damaged_files_neither_panic_nor_take_memory() {
    let before = peak_kib();
    let files = files();
    for (format, bytes) in &files {
        check(&read(bytes, "a", &options(None)).unwrap());
        for length in 0..bytes.len() {
            let outcome = read(&bytes[..length], "a", &options(Some(*format)));
            let is_text = matches!(
                format,
                Format::Obj | Format::Domeprojection | Format::Bourke
            );
            assert!(
                is_text || outcome.is_err(),
                "{format:?} cut to {length} bytes"
            );
        }
    }
    let parts = lamp();
    let config = ProptestConfig {
        cases: 4000,
        failure_persistence: None,
        ..ProptestConfig::default()
    };
    let mut runner = proptest::test_runner::TestRunner::new(config);
    let strategy = (0..files.len(), 0..parts.len(), damages());
    runner
        .run(&strategy, |(file, part, damages)| {
            let (format, bytes) = &files[file];
            for format in [None, Some(*format)] {
                if let Ok(calibration) = read(&damaged(bytes, &damages), "a.x", &options(format)) {
                    check(&calibration);
                }
            }
            // The checksums of an archive hide most damage: damage a part and pack it well.
            let mut parts = parts.clone();
            parts[part].1 = damaged(&parts[part].1, &damages);
            if let Ok(calibration) = read(&pack(&parts), "a.mpcdi", &options(None)) {
                check(&calibration);
            }
            Ok(())
        })
        .unwrap();
    let grown = peak_kib().saturating_sub(before);
    assert!(grown < BOUND_KIB, "{grown} KiB more than at the start");
}
