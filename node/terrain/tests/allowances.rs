//! Allowances: what they let stay is within τ, they are nested, and they let stay nearly all that may.
#![allow(
    clippy::unwrap_used,
    clippy::expect_used,
    reason = "a test that panics has failed"
)]

mod common;
mod oracle_ground;

use common::Random;
use geodesy::{Ellipsoid, LatticePoint, Tile};
use glam::DVec3;
use oracle_ground::{GROUNDS, Ground, Leaf, eye_in, eye_over, fractal, random_tile, width_m};
use terrain::{
    ALLOWANCE_WORDS, BLOCKS, Domain, EyeCell, LodLimits, LodView, Marks, RefineView, code_down,
    decode, eye_cell, height_unit, minimum, pair, select, top_down, triangles,
};

const PLANETS: [Ellipsoid; 3] = [Ellipsoid::EARTH, Ellipsoid::MOON, Ellipsoid::MARS];

/// Reliefs as shares of a tile's width, so that every level gets gentle and steep ground.
fn relief_m(random: &mut Random, ellipsoid: &Ellipsoid, tile: Tile) -> f64 {
    let share = 10_f64.powf(random.between(-4.0, 0.0));
    (share * width_m(ellipsoid, tile)).min(30_000.0)
}

#[test]
fn no_sample_is_ever_off_by_more_than_tau() {
    let mut random = Random(41);
    let (mut worst, mut meshes, mut coarse) = (0.0_f64, 0, 0);
    for round in 0..190_usize {
        let level = (round % 19) as u8;
        let ground = GROUNDS[round / 19 % GROUNDS.len()];
        let ellipsoid = PLANETS[round % 3];
        let tile = random_tile(&mut random, level);
        let relief_m = relief_m(&mut random, &ellipsoid, tile);
        let leaf = Leaf::new(&ellipsoid, tile, ground, relief_m, random.next());
        for tau_px in [0.5, 1.0, 4.0] {
            let widths = 10_f64.powf(random.between(-2.5, 1.5));
            let sine = random.between(-0.05, 1.0).powi(2);
            let eye = eye_over(&mut random, &leaf, widths, sine);
            let view = RefineView {
                eye,
                pixels_per_radian: random.between(500.0, 2000.0),
                tau_px,
            };
            let cell = eye_cell(&ellipsoid, tile, leaf.range_m(), eye);
            assert!(eye.distance(cell.centre) <= cell.radius_m);
            let marks = leaf.refine(&leaf.table(&view, &cell));
            for eye in [eye, eye_in(&mut random, &cell), eye_in(&mut random, &cell)] {
                let measured = leaf.measure(&marks, eye, view.pixels_per_radian);
                assert_eq!(measured.uncovered, 0);
                assert_eq!(measured.samples, 257 * 257);
                assert!(
                    measured.max_px <= tau_px,
                    "{measured:?} for τ {tau_px}, {ground:?} of {relief_m} m on {tile}, eye {eye}, {widths} widths, sine {sine}"
                );
                worst = worst.max(measured.max_px / tau_px);
            }
            meshes += 1;
            coarse += usize::from(triangles(&marks).len() < 60_000);
        }
    }
    eprintln!("{meshes} meshes, {coarse} of them below 60,000 triangles; worst error {worst} τ");
    assert!(worst > 0.7, "the views do not try the bound: {worst}");
    assert!(
        coarse > meshes / 3,
        "hardly any mesh was coarse: {coarse} of {meshes}"
    );
}

/// A table with twice the units.
fn doubled(table: &[u32]) -> Vec<u32> {
    let double = |limit: u32| match limit {
        0 => 0,
        limit => u32::from(code_down(2 * decode((limit - 1) as u16))) + 1,
    };
    table
        .iter()
        .map(|word| double(word & 0xffff) | double(word >> 16) << 16)
        .collect()
}

#[test]
fn a_bound_twice_as_lax_would_be_noticed() {
    let mut random = Random(42);
    let mut broken = 0;
    for round in 0..20 {
        let tile = random_tile(&mut random, 6 + round % 10);
        let ground = [
            Ground::Spikes,
            Ground::Cliff,
            Ground::Fractal,
            Ground::Coast,
        ][usize::from(round % 4)];
        let relief_m = 0.03 * width_m(&Ellipsoid::EARTH, tile);
        let leaf = Leaf::new(&Ellipsoid::EARTH, tile, ground, relief_m, random.next());
        let eye = eye_over(&mut random, &leaf, 4.0, 0.5);
        let view = RefineView {
            eye,
            pixels_per_radian: 1000.0,
            tau_px: 2.0,
        };
        let table = leaf.table(
            &view,
            &eye_cell(&Ellipsoid::EARTH, tile, leaf.range_m(), eye),
        );
        let error = |table: &[u32]| leaf.measure(&leaf.refine(table), eye, 1000.0).max_px;
        assert!(error(&table) <= 2.0);
        broken += usize::from(error(&doubled(&table)) > 2.0);
    }
    eprintln!("{broken} of 20 views would break");
    assert!(
        broken >= 10,
        "only {broken} of 20 views notice a bound twice as lax"
    );
}

#[test]
fn limits_are_nested() {
    let mut random = Random(43);
    for round in 0..60 {
        let tile = random_tile(&mut random, round % 19);
        let relief_m = relief_m(&mut random, &Ellipsoid::MARS, tile);
        let ground = GROUNDS[random.below(GROUNDS.len() as u64) as usize];
        let leaf = Leaf::new(&Ellipsoid::MARS, tile, ground, relief_m, random.next());
        let widths = 10_f64.powf(random.between(-1.0, 2.0));
        let sine = random.unit();
        let eye = eye_over(&mut random, &leaf, widths, sine);
        let view = RefineView {
            eye,
            pixels_per_radian: 1000.0,
            tau_px: 4.0,
        };
        let table = leaf.table(&view, &EyeCell::exact(eye));
        assert_eq!(table.len(), ALLOWANCE_WORDS);
        // The limit of a triangle by mark and side, as the table is read.
        let limit = |[x, y]: [u16; 2], side: usize| {
            let own = pair(8, x, y).unwrap();
            let apex = own.apexes[side].unwrap();
            if own.level < 7 {
                let word = table[BLOCKS + usize::from(y / 16) * 17 + usize::from(x / 16)];
                word >> (16 * side) & 0xffff
            } else {
                let block = usize::from((y + apex[1]) >> 5) * 16 + usize::from((x + apex[0]) >> 5);
                table[block] >> (if own.level < 9 { 16 } else { 0 }) & 0xffff
            }
        };
        for y in 0..=256 {
            for x in 0..=256 {
                let Some(own) = pair(8, x, y).filter(|own| own.level < 14) else {
                    continue;
                };
                for (side, apex) in own.apexes.iter().enumerate() {
                    let Some(apex) = apex else { continue };
                    for end in own.ends {
                        let child = [
                            u16::midpoint(apex[0], end[0]),
                            u16::midpoint(apex[1], end[1]),
                        ];
                        let facing = pair(8, child[0], child[1]).unwrap().apexes;
                        let facing = facing
                            .iter()
                            .position(|apex| *apex == Some([x, y]))
                            .unwrap();
                        assert!(limit([x, y], side) <= limit(child, facing));
                    }
                }
            }
        }
    }
}

/// Triangles by the bound, and at least needed.
fn counts(leaf: &Leaf, view: &RefineView, cell: &EyeCell) -> (usize, usize) {
    let count = |marks: &Marks| triangles(marks).len();
    (
        count(&leaf.refine(&leaf.table(view, cell))),
        count(&leaf.minimum(view)),
    )
}

#[test]
fn few_triangles_are_wasted() {
    let mut random = Random(44);
    let mut all = (0, 0);
    for (name, levels, ground, share) in [
        ("from space", 1..4_u8, Ground::Fractal, 1e-3),
        ("high above", 4..8, Ground::Fractal, 0.02),
        ("mountains", 8..14, Ground::Fractal, 0.2),
        ("hills", 8..14, Ground::Fractal, 0.05),
        ("coast", 8..14, Ground::Coast, 0.1),
        ("near", 14..18, Ground::Fractal, 0.2),
    ] {
        for (slope, sines) in [
            ("grazing", 0.03..0.2),
            ("oblique", 0.2..0.8),
            ("nadir", 0.8..1.0),
        ] {
            let (mut by_cell, mut by_eye, mut least) = (0, 0, 0);
            for _ in 0..12 {
                let level = levels.start + random.below(u64::from(levels.end - levels.start)) as u8;
                let tile = random_tile(&mut random, level);
                let relief_m = share * width_m(&Ellipsoid::EARTH, tile);
                let leaf = Leaf::new(&Ellipsoid::EARTH, tile, ground, relief_m, random.next());
                // A tile of 257 pixels' square by its solid angle.
                let sine = random.between(sines.start, sines.end);
                let widths = 1200.0 / 257.0 * f64::sqrt(sine);
                let eye = eye_over(&mut random, &leaf, widths, sine);
                let view = RefineView {
                    eye,
                    pixels_per_radian: 1200.0,
                    tau_px: 1.0,
                };
                let cell = eye_cell(&Ellipsoid::EARTH, tile, leaf.range_m(), eye);
                let (ours, minimum) = counts(&leaf, &view, &cell);
                by_cell += ours;
                least += minimum;
                by_eye += counts(&leaf, &view, &EyeCell::exact(eye)).0;
            }
            eprintln!(
                "{name:>10}, {slope:>7}: {by_cell:>7} triangles, {least:>7} at least: {:.3}; {:.3} without cells",
                by_cell as f64 / least as f64,
                by_eye as f64 / least as f64
            );
            all = (all.0 + by_cell, all.1 + least);
        }
    }
    let ratio = all.0 as f64 / all.1 as f64;
    eprintln!("all together {ratio:.3}");
    assert!(ratio < 1.32, "{ratio} times the triangles that are needed");
}

#[test]
fn leaves_of_a_selection_keep_the_bound_beside_each_other() {
    let mut random = Random(45);
    let ellipsoid = Ellipsoid::EARTH;
    let (mut ours, mut least, mut worst) = (0, 0, 0.0_f64);
    for round in 0..18_usize {
        let (latitude, longitude) = common::PLACES[round % common::PLACES.len()];
        let over = (Ellipsoid::normal(latitude, longitude) + random.direction() * 1e-3).normalize();
        let seed = random.next();
        let height_m = |normal: DVec3| 4000.0 * fractal(normal, 7, seed);
        let altitude_m = [2.0, 30.0, 1e3, 2e4, 3e5, 1e7][round % 6];
        let eye = ellipsoid.point(over, height_m(over) + altitude_m);
        let ranges = |_: Tile| (-2000.0, 2000.0);
        let limits = LodLimits {
            deepest_level: 13,
            ..LodLimits::default()
        };
        let pixels_per_radian = 1200.0;
        let view = LodView {
            eye,
            pixels_per_radian,
        };
        let selection = select(&ellipsoid, &view, &limits, &ranges);
        // Around the first place that leaves of two levels meet, from the nearest on.
        let distance = |tile: &Tile| {
            let middle = LatticePoint::of_tile(*tile, 128, 128).normal();
            ellipsoid.point(middle, 0.0).distance(eye)
        };
        let mut tiles = selection.leaves().to_vec();
        tiles.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
        let level = tiles[0].level();
        let change = tiles
            .iter()
            .position(|tile| tile.level() != level)
            .unwrap_or(0);
        let mut tiles = tiles[change.saturating_sub(6)..].to_vec();
        tiles.truncate(12);
        tiles.sort_unstable();
        let domain = Domain::new(&selection, &tiles);
        let leaves: Vec<Leaf> = domain
            .leaves
            .iter()
            .map(|leaf| {
                let heights = (0..257).flat_map(|y| (0..257).map(move |x| (x, y)));
                let heights =
                    heights.map(|(x, y)| height_m(LatticePoint::of_tile(leaf.tile, x, y).normal()));
                Leaf::of_heights(&ellipsoid, leaf.tile, heights.collect()).beside(leaf.coarser)
            })
            .collect();
        for tau_px in [0.5, 1.0, 4.0] {
            let view = RefineView {
                eye,
                pixels_per_radian,
                tau_px,
            };
            let tables: Vec<Vec<u32>> = leaves
                .iter()
                .map(|leaf| {
                    leaf.table(&view, &eye_cell(&ellipsoid, leaf.tile, leaf.range_m(), eye))
                })
                .collect();
            let errors: Vec<&[u32]> = leaves.iter().map(|leaf| &leaf.errors[..]).collect();
            let tables: Vec<&[u32]> = tables.iter().map(|table| &table[..]).collect();
            let heights: Vec<&[f64]> = leaves.iter().map(|leaf| &leaf.heights_m[..]).collect();
            let marks = top_down(&domain, &errors, &tables);
            let smallest = minimum(
                &domain,
                &ellipsoid,
                &heights,
                eye,
                pixels_per_radian,
                tau_px,
            );
            for ((leaf, marks), smallest) in leaves.iter().zip(&marks).zip(&smallest) {
                let measured = leaf.measure(marks, eye, pixels_per_radian);
                assert_eq!(measured.uncovered, 0);
                assert!(
                    measured.max_px <= tau_px,
                    "{measured:?} for τ {tau_px} on {} from {altitude_m} m, round {round}",
                    leaf.tile
                );
                worst = worst.max(measured.max_px / tau_px);
                ours += triangles(marks).len();
                least += triangles(smallest).len();
                // What is called the minimum keeps the bound too, but for the rounding of heights to units.
                let smallest = leaf.measure(smallest, eye, pixels_per_radian);
                assert!(
                    smallest.max_px <= tau_px + 0.1,
                    "{smallest:?} for τ {tau_px}"
                );
            }
        }
    }
    let ratio = ours as f64 / least as f64;
    eprintln!("{ours} triangles, {least} at least: {ratio:.3}; worst {worst} τ");
    assert!(worst > 0.7 && ratio < 1.55);
}

#[test]
fn nothing_may_deviate_where_it_cannot_be_bounded() {
    let ellipsoid = Ellipsoid::EARTH;
    let tile: Tile = "0/9/300/200".parse().unwrap();
    let leaf = Leaf::new(&ellipsoid, tile, Ground::Fractal, 1000.0, 3);
    let normal = LatticePoint::of_tile(tile, 128, 128).normal();
    let eye = ellipsoid.point(normal, 200_000.0);
    let view = RefineView {
        eye,
        pixels_per_radian: 1000.0,
        tau_px: 1.0,
    };
    let exact = EyeCell::exact(eye);
    assert!(
        leaf.table(&view, &exact)[..BLOCKS]
            .iter()
            .all(|word| *word != 0)
    );
    for tau_px in [0.0, -1.0, 0.01, f64::NAN] {
        let table = leaf.table(&RefineView { tau_px, ..view }, &exact);
        assert!(table.iter().all(|word| *word == 0), "τ {tau_px}");
    }
    // Not a number, and within the ground.
    for eye in [DVec3::NAN, DVec3::INFINITY] {
        assert!(
            leaf.table(&view, &EyeCell::exact(eye))
                .iter()
                .all(|word| *word == 0)
        );
    }
    let inside = leaf.table(
        &view,
        &EyeCell::exact(ellipsoid.point(normal, leaf.heights_m[128 * 257 + 128])),
    );
    assert_eq!(inside[8 * 16 + 8], 0);
    // A block without a range is refined to the end, and so is whatever holds it.
    let mut lacking = leaf.blocks.clone();
    lacking.0.truncate(255);
    lacking.0[0] = (f64::NAN, 0.0);
    let table = terrain::allowances(&leaf.geometry, &lacking, leaf.unit_m, &view, &exact);
    assert_eq!((table[0], table[255]), (0, 0));
    assert_ne!(table[1], 0);
    // The triangles at the left, lower, right and upper edge of the tile.
    for (x, y) in [(0, 8), (8, 0), (16, 8), (8, 16)] {
        assert_eq!(table[BLOCKS + y * 17 + x], 0, "{x}, {y}");
    }
}

#[test]
fn units_hold_every_height() {
    for (range_m, unit_m) in [
        ((0.0, 0.0), 1.0 / 8192.0),
        ((-11_000.0, 8849.0), 1.0 / 8192.0),
        ((-16_384.0, 16_384.0), 1.0 / 8192.0),
        ((-16_385.0, 0.0), 1.0 / 4096.0),
        ((0.0, 100_000.0), 1.0 / 1024.0),
        ((0.0, 1e9), 8.0),
    ] {
        assert_eq!(height_unit(range_m), unit_m);
    }
}
