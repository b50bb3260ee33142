//! All patterns at all kinds of sizes, and what is where in them.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use super::*;

fn about(size_px: [u32; 2]) -> About {
    let [width, height] = size_px;
    About {
        wall: "lab".into(),
        host: "left".into(),
        output: "projector".into(),
        adapter: "A graphics adapter (Vulkan 1.3)".into(),
        size_px,
        channels: vec![ChannelAbout {
            screen: "front".into(),
            eye: "left".into(),
            rect: Rect {
                x: 0,
                y: 0,
                width,
                height,
            },
            ramps_px: [0, 200, 0, 0],
        }],
        stereo: "off".into(),
        gamma: Some(2.2),
    }
}

fn pixel(bytes: &[u8], [width, _]: [u32; 2], x: u32, y: u32) -> [u8; 3] {
    let start = 4 * (y as usize * width as usize + x as usize);
    bytes[start..start + 3].try_into().unwrap()
}

#[test]
fn every_pattern_can_be_drawn_at_every_size_and_is_always_the_same() {
    let sizes = [
        [1, 1],
        [16, 16],
        [64, 48],
        [1920, 1080],
        [1, 16_384],
        [16_384, 3],
        [17, 1001],
        [333, 211],
        [41, 5],
        [42, 5],
    ];
    for size_px in sizes {
        let about = about(size_px);
        let pictures = Pattern::NAMES.map(|(pattern, name)| {
            let bytes = draw(pattern, &about);
            assert_eq!(bytes.len(), 4 * size_px[0] as usize * size_px[1] as usize);
            assert!(
                bytes.iter().skip(3).step_by(4).all(|alpha| *alpha == 255),
                "{name}"
            );
            assert_eq!(bytes, draw(pattern, &about), "{name} {size_px:?}");
            bytes
        });
        if size_px[0].min(size_px[1]) >= 16 {
            for (number, picture) in pictures.iter().enumerate() {
                assert!(
                    !pictures[..number].contains(picture),
                    "{number} {size_px:?}"
                );
            }
        }
    }
}

#[test]
fn sizes_that_no_wall_has_give_an_empty_picture() {
    for size_px in [
        [0, 0],
        [0, 5],
        [5, 0],
        [16_385, 1],
        [1, u32::MAX],
        [u32::MAX; 2],
    ] {
        for (pattern, _) in Pattern::NAMES {
            assert!(draw(pattern, &about(size_px)).is_empty(), "{size_px:?}");
        }
    }
}

#[test]
fn whatever_names_and_channels_there_are_something_is_drawn() {
    let long = "née 漢字\n\0 ".repeat(5000);
    let channel = |number: u32| ChannelAbout {
        screen: long.clone(),
        eye: String::new(),
        rect: Rect {
            x: number.wrapping_mul(0x9e37_79b1) >> (number % 32),
            y: number.wrapping_mul(0x85eb_ca6b) >> (number % 31),
            width: u32::MAX >> (number % 32),
            height: number,
        },
        ramps_px: [u32::MAX, 0, number, 7],
    };
    let odd = About {
        wall: long.clone(),
        host: String::new(),
        output: long.clone(),
        adapter: long.clone(),
        size_px: [400, 300],
        channels: (0..64).map(channel).collect(),
        stereo: long.clone(),
        gamma: None,
    };
    for (pattern, name) in Pattern::NAMES {
        let bytes = draw(pattern, &odd);
        assert_eq!(bytes, draw(pattern, &odd), "{name}");
        let first = &bytes[..3];
        assert!(
            bytes
                .as_chunks::<4>()
                .0
                .iter()
                .any(|other| other[..3] != *first),
            "{name}"
        );
        assert!(
            !draw(
                pattern,
                &About {
                    channels: Vec::new(),
                    ..odd.clone()
                }
            )
            .is_empty()
        );
    }
}

#[test]
fn borders_are_on_the_outermost_pixels() {
    let size_px = [640, 361];
    let [width, height] = size_px;
    let mut about = about(size_px);
    about.channels[0].rect = Rect {
        x: 30,
        y: 40,
        width: 303,
        height: 200,
    };
    let bytes = draw(Pattern::Grid, &about);
    for x in 0..width {
        for y in 0..height {
            let outermost = x == 0 || y == 0 || x == width - 1 || y == height - 1;
            let here = pixel(&bytes, size_px, x, y);
            if outermost {
                assert_eq!(here, grid::OUTPUT_BORDER, "{x} {y}");
            }
            let inside = (30..333).contains(&x) && (40..240).contains(&y);
            let deeper = (31..332).contains(&x) && (41..239).contains(&y);
            assert_eq!(here == grid::CHANNEL_BORDER, inside && !deeper, "{x} {y}");
        }
    }
}

#[test]
fn lines_of_the_grid_are_where_their_numbers_say() {
    let size_px = [1920, 1080];
    let bytes = draw(Pattern::Grid, &about(size_px));
    let at = |x: u32, y: u32| pixel(&bytes, size_px, x, y);
    let ground = at(300, 300);
    // A row and a column that no text, circle or diagonal comes near.
    for x in 1344..1344 + 130 {
        let expected = x % 64 == 0;
        assert_eq!(at(x, 1000) != ground, expected, "column {x}");
    }
    let bold: Vec<u32> = (1500..1580)
        .filter(|x| at(*x, 990) == at(1536, 990))
        .collect();
    assert_eq!(bold, [1535, 1536, 1537]);
    let bold: Vec<u32> = (740..800).filter(|y| at(60, *y) == at(60, 768)).collect();
    assert_eq!(bold, [767, 768, 769]);
    assert!(at(1536, 990) != at(1344, 1000));
}

#[test]
fn pairs_of_lines_are_one_and_two_pixels_wide_both_ways() {
    let size_px = [1920, 1080];
    let bytes = draw(Pattern::Focus, &about(size_px));
    // The field at the left edge is 236 px wide, around the row of the middle: four parts, one in each quarter.
    let at = |x: u32, y: u32| pixel(&bytes, size_px, x, y);
    let (x, y) = (183, 540);
    for (left, top, thickness, upright) in [
        (x - 60, y - 60, 1, true),
        (x + 40, y - 60, 2, true),
        (x - 60, y + 40, 1, false),
        (x + 40, y + 40, 2, false),
    ] {
        let along = |number: u32| {
            if upright {
                (at(left + number, top), at(left + number, top + 9))
            } else {
                (at(left, top + number), at(left + 9, top + number))
            }
        };
        for number in 0..20 {
            let (here, beside) = along(number);
            assert_eq!(here, beside);
            let (next, _) = along(number + thickness);
            assert!([[0; 3], [255; 3]].contains(&here));
            assert_eq!(here[0], 255 - next[0], "{upright} {thickness} {number}");
        }
    }
}

#[test]
fn half_the_light_of_a_star_is_white() {
    let size_px = [900, 900];
    for gamma in [None, Some(1.0), Some(2.2)] {
        let about = About {
            gamma,
            ..about(size_px)
        };
        let bytes = draw(Pattern::Focus, &about);
        let mut light = [0.0; 2];
        let mut pixels = [0.0; 2];
        for x in 200..700 {
            for y in 200..700 {
                let from_middle = f64::hypot(f64::from(x) - 449.5, f64::from(y) - 449.5);
                let part = usize::from(from_middle > 12.0);
                if from_middle < 270.0 {
                    let value = f64::from(pixel(&bytes, size_px, x, y)[0]) / 255.0;
                    light[part] += match gamma {
                        Some(gamma) => value.powf(gamma),
                        None if value <= 0.040_45 => value / 12.92,
                        None => ((value + 0.055) / 1.055).powf(2.4),
                    };
                    pixels[part] += 1.0;
                }
            }
        }
        for (light, pixels) in light.iter().zip(pixels) {
            let share: f64 = light / pixels;
            assert!((share - 0.5).abs() < 0.01, "{gamma:?}: {share}");
        }
        // Where spokes are finer than half a pixel there is nothing but grey.
        let middle = pixel(&bytes, size_px, 449, 449);
        assert_eq!(middle, pixel(&bytes, size_px, 453, 451));
        assert!(middle != [0; 3] && middle != [255; 3]);
    }
}

#[test]
fn grounds_tell_outputs_apart_and_white_is_easy_to_read_on_them() {
    let hosts = [
        "a", "b", "c", "left", "right", "front", "floor", "node1", "node2", "node3",
    ];
    let mut seen = Vec::new();
    for host in hosts {
        for output in ["1", "2", "left", "right", "projector"] {
            let ground = identify::ground(host, output);
            assert_eq!(ground, identify::ground(host, output));
            assert!((40..=90).contains(&paper::brightness(ground)), "{ground:?}");
            assert!(!seen.contains(&ground), "{host} {output}");
            seen.push(ground);
        }
    }
    // They go around the whole circle of hues: each of the colours is somewhere the strongest, and somewhere the weakest.
    for colour in 0..3 {
        let of = |ground: &[u8; 3]| ground[colour];
        assert!(
            seen.iter()
                .any(|ground| ground.iter().all(|other| *other <= of(ground)))
        );
        assert!(
            seen.iter()
                .any(|ground| ground.iter().all(|other| *other >= of(ground)))
        );
    }
}
