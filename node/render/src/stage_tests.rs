//! Every compute stage on a device against its CPU twin, on real tiles, with the largest difference of each in one
//! table. In: the embedded data, a device. Without an adapter the test says so and passes, unless `REQUIRE_GPU=1`.
#![allow(
    clippy::unwrap_used,
    clippy::print_stderr,
    reason = "a test that panics has failed, and its table is for reading"
)]

mod comparison;
mod data;
mod harness;

use geodesy::{Circle, Ellipsoid, Tile};
use shaders::{
    AspectUniform, Blend, ElevationUniform, FuseInput, FuseUniform, HillshadeUniform,
    ImageryUniform, IsolinesUniform, LensUniform, RampUniform, ReliefUniform, ResampleUniform,
    SampleForm, SarUniform, SlopeUniform, Stage, SurfaceUniform, TileGeometry, cpu,
};

use self::comparison::{Comparison, Unit};
use self::data::{Data, SUMMIT};
use crate::device_tests::device;

impl Comparison {
    fn relief(&mut self, tile: Tile, heights: &[u32]) {
        let uniform = ReliefUniform {
            tile: geometry(tile),
            layer: harness::LAYER,
            padding: [0; 3],
        };
        let texels = cpu::relief::run(&uniform, &[heights]);
        let twin = texels
            .iter()
            .map(|[x, y]| u32::from_le_bytes([*x as u8, *y as u8, 0, 0]))
            .collect();
        self.run(
            Stage::Relief,
            Unit::Steps,
            &uniform,
            &[heights],
            twin,
            |_| false,
        );
    }

    /// All stages that make colours of heights; returns what they made.
    fn textures(&mut self, tile: Tile, heights: &[u32]) -> Vec<Vec<u32>> {
        let (heights, tile) = (&[heights][..], geometry(tile));
        let codes = Unit::Codes;
        let lines = IsolinesUniform {
            spacing_m: 50.0,
            half_width: 0.6,
            bold_half_width: 1.5,
            bold_every: 5,
            colour: [0.3, 0.2, 0.1, 1.0],
        };
        let slope = SlopeUniform {
            tile,
            gentle: [0.9, 0.9, 0.7, 1.0],
            steep: [0.6, 0.0, 0.1, 1.0],
            range_deg: [0.0, 45.0],
            padding: [0; 2],
        };
        let aspect = AspectUniform {
            tile,
            saturation: 0.8,
            brightness: 0.9,
            flat_sine: 1_f32.to_radians().sin(),
            padding: 0,
        };
        // From the north-west, 45° high.
        let shade = HillshadeUniform {
            tile,
            light: [-0.5, 0.5, std::f32::consts::FRAC_1_SQRT_2],
            exaggeration: 1.5,
        };
        vec![
            self.slot(Stage::Ramp, codes, &ramp(), heights, cpu::ramp::run),
            self.slot(Stage::Isolines, codes, &lines, heights, cpu::isolines::run),
            self.slot(Stage::Slope, codes, &slope, heights, cpu::slope::run),
            self.slot(Stage::Aspect, codes, &aspect, heights, cpu::aspect::run),
            self.slot(
                Stage::Hillshade,
                codes,
                &shade,
                heights,
                cpu::hillshade::run,
            ),
        ]
    }

    /// The radar stages; returns what they made.
    fn radar(&mut self, amplitudes: &[u32]) -> Vec<Vec<u32>> {
        let uniform = SarUniform {
            lowest: 10.0,
            highest: 60_000.0,
            strength: 100.0,
            exponent: 0.7,
            tint: [1.0, 0.9, 0.8, 1.0],
        };
        let (inputs, codes) = (&[amplitudes][..], Unit::Codes);
        vec![
            self.slot(
                Stage::SarLinear,
                codes,
                &uniform,
                inputs,
                cpu::sar_linear::run,
            ),
            self.slot(
                Stage::SarLogarithmic,
                codes,
                &uniform,
                inputs,
                cpu::sar_logarithmic::run,
            ),
            self.slot(
                Stage::SarGamma,
                codes,
                &uniform,
                inputs,
                cpu::sar_gamma::run,
            ),
        ]
    }

    /// Both imagery runs, one of which changes nothing; returns what they made.
    fn imagery(&mut self, raw: &[u32]) -> Vec<Vec<u32>> {
        let plain = ImageryUniform {
            gain: 1.0,
            contrast: 1.0,
            saturation: 1.0,
            inverse_gamma: 1.0,
            tint: [1.0; 4],
        };
        let changed = ImageryUniform {
            gain: 2.3,
            contrast: 1.4,
            saturation: 0.6,
            inverse_gamma: 0.8,
            tint: [1.0, 0.8, 0.7, 1.0],
        };
        [plain, changed]
            .map(|uniform| {
                self.slot(
                    Stage::Imagery,
                    Unit::Codes,
                    &uniform,
                    &[raw],
                    cpu::imagery::run,
                )
            })
            .into()
    }

    /// Both sides of a circle about the summit; words within 1e-4 of the rim may fall on either.
    fn lens(&mut self, tile: Tile, radius_m: f64, outside: &[u32], inside: &[u32]) -> Vec<u32> {
        let circle = Circle::new(&Ellipsoid::EARTH, SUMMIT[0], SUMMIT[1], radius_m).unwrap();
        let polynomial = circle.polynomial(tile);
        let mut uniform = LensUniform {
            degree: polynomial.degree as u32,
            padding: [0; 3],
            coefficients: [[0.0; 4]; 21],
        };
        for (n, coefficient) in polynomial.coefficients.iter().enumerate() {
            uniform.coefficients[n / 4][n % 4] = *coefficient as f32;
        }
        let on_rim = |index: usize| {
            let node = [index as i32 % 275 - 9, index as i32 / 275 - 9];
            cpu::lens::polynomial(&uniform, node).abs() < 1e-4
        };
        let twin = cpu::lens::run(&uniform, &[outside, inside]);
        for (side, words) in [("outside", outside), ("inside", inside)] {
            let seen = twin.iter().zip(words).filter(|(a, b)| a == b).count();
            assert!(
                seen > 5000,
                "{tile}: the circle has too little {side}: {seen}"
            );
        }
        let rim = (0..twin.len()).filter(|index| on_rim(*index)).count();
        assert!(rim < 500, "{tile}: {rim} words lie on the rim");
        self.run(
            Stage::Lens,
            Unit::Codes,
            &uniform,
            &[outside, inside],
            twin,
            on_rim,
        )
    }
}

fn geometry(tile: Tile) -> TileGeometry {
    let radius_m = 6_367_444.7;
    TileGeometry::new(
        tile.face().number(),
        tile.level(),
        tile.x(),
        tile.y(),
        radius_m,
    )
}

/// Thirteen stops from the deep sea to the summits.
fn ramp() -> RampUniform {
    let mut uniform = RampUniform {
        count: 13,
        padding: [0; 3],
        heights: [[0.0; 4]; 8],
        colours: [[0; 4]; 8],
    };
    for n in 0..13_u32 {
        let (row, column) = (n as usize / 4, n as usize % 4);
        uniform.heights[row][column] = -8000.0 + 1000.0 * n as f32;
        uniform.colours[row][column] = 0xFF00_0000 | n.wrapping_mul(0x0059_A13D) & 0x00FF_FFFF;
    }
    uniform
}

/// Inputs (weight, opacity, blend) in groups of equal blend.
fn fusion(inputs: &[(f32, f32, Blend)]) -> FuseUniform {
    let none = FuseInput {
        weight: 0.0,
        opacity: 0.0,
        blend: 0,
        group: 0,
    };
    let mut uniform = FuseUniform {
        count: inputs.len() as u32,
        padding: [0; 3],
        inputs: [none; 8],
    };
    let mut group = 0;
    for (n, (weight, opacity, blend)) in inputs.iter().enumerate() {
        group += u32::from(n > 0 && inputs[n - 1].2 != *blend);
        uniform.inputs[n] = FuseInput {
            weight: *weight,
            opacity: *opacity,
            blend: *blend as u32,
            group,
        };
    }
    uniform
}

fn resampling(tile: Tile, ancestor: Tile, form: SampleForm) -> ResampleUniform {
    let shift = u32::from(tile.level() - ancestor.level());
    let along = |fine: u32, coarse: u32| ((fine - (coarse << shift)) * 256) as i32;
    ResampleUniform {
        origin: [along(tile.x(), ancestor.x()), along(tile.y(), ancestor.y())],
        shift,
        form: form as u32,
    }
}

#[test]
fn every_stage_on_a_device_is_its_twin_on_real_tiles() {
    let Some(gpu) = device() else { return };
    let data = Data::import();
    let mut all = Comparison::new(gpu);
    // The whole face, a tile of half known ground, and one in the middle of the finer model.
    for level in [0, 3, 7, 9] {
        let tile = Data::summit_tile(level);
        let globe_tile = Data::summit_tile(level.min(3));
        let numbers = resampling(tile, globe_tile, SampleForm::Number);
        let coarse = data.heights("globe", globe_tile);
        let globe = all.slot(
            Stage::Resample,
            Unit::Metres,
            &numbers,
            &[&coarse],
            cpu::resample::run,
        );
        let cell = data.heights("cell", tile);
        let raw_coarse = data.colours(globe_tile, &coarse);
        let colours = resampling(tile, globe_tile, SampleForm::RawColour);
        let raw = all.slot(
            Stage::Resample,
            Unit::RawCodes,
            &colours,
            &[&raw_coarse],
            cpu::resample::run,
        );
        // The same from data with holes: on the tile's own parent, and of colours that only the cell has.
        if let Some(parent) = tile.parent() {
            let numbers = resampling(tile, parent, SampleForm::Number);
            let inputs = &[&data.heights("cell", parent)[..]];
            let run = cpu::resample::run;
            all.slot(Stage::Resample, Unit::Metres, &numbers, inputs, run);
        }
        let holed = data.colours(globe_tile, &data.heights("cell", globe_tile));
        let run = cpu::resample::run;
        all.slot(Stage::Resample, Unit::RawCodes, &colours, &[&holed], run);
        all.imagery(&holed);
        let changed = ElevationUniform {
            scale: 1.7,
            datum_shift_m: 53.2,
            offset_m: -12.5,
            lowest_m: -4000.0,
            highest_m: 7500.0,
            padding: [0; 3],
        };
        let run = cpu::elevation::run;
        let high = all.slot(Stage::Elevation, Unit::Metres, &changed, &[&cell], run);
        let low = all.slot(Stage::Elevation, Unit::Metres, &changed, &[&globe], run);
        let heights = all.heights(&globe, &cell, &high, &low);
        all.relief(tile, &heights);
        all.relief(tile, &cell);
        let mut layers = all.textures(tile, &heights);
        all.textures(tile, &cell);
        layers.extend(all.imagery(&raw));
        // Raw amplitudes with the cell's holes, so that the coarser picture shows through.
        layers.extend(all.radar(&data.amplitudes(globe_tile, &cell)));
        let colour = all.colours(&layers);
        // A circle whose rim crosses the tile.
        let radius_m = 2.5e6 / f64::from(1_u32 << level);
        let lens = all.lens(tile, radius_m, &colour, &layers[0]);
        for words in [&lens, &layers[3], &layers[7]] {
            let uniform = SurfaceUniform {
                ground: [0.588, 0.573, 0.541, 1.0],
                layer: harness::LAYER,
                padding: [0; 3],
            };
            let twin = cpu::surface::run(&uniform, &[words]);
            all.run(
                Stage::Surface,
                Unit::Codes,
                &uniform,
                &[words],
                twin,
                |_| false,
            );
        }
    }
    all.print();
    all.check();
}

impl Comparison {
    /// Two models in several ways; returns the finer over the coarser.
    fn heights(&mut self, globe: &[u32], cell: &[u32], high: &[u32], low: &[u32]) -> Vec<u32> {
        let normal = Blend::Normal;
        let of_eight = [
            (1.0, 1.0, normal),
            (3.0, 0.7, normal),
            (0.0, 1.0, normal),
            (0.4, 0.3, Blend::Add),
            (2.0, 0.2, Blend::Add),
            (1.0, 0.6, normal),
            (5.0, 0.0, normal),
            (0.7, 0.9, normal),
        ];
        let eight = [globe, low, high, cell, globe, cell, low, high];
        let run = cpu::fuse_elevation::run;
        self.slot(
            Stage::FuseElevation,
            Unit::Metres,
            &fusion(&of_eight),
            &eight,
            run,
        );
        let of_cell = fusion(&[(1.0, 0.5, normal), (2.0, 1.0, normal)]);
        self.slot(
            Stage::FuseElevation,
            Unit::Metres,
            &of_cell,
            &[cell, high],
            run,
        );
        let of_two = [(1.0, 1.0, normal), (1.0, 1.0, normal)];
        let mut uniform = fusion(&of_two);
        uniform.inputs[1].group = 1;
        self.slot(
            Stage::FuseElevation,
            Unit::Metres,
            &uniform,
            &[globe, cell],
            run,
        )
    }

    /// All colours in one, with every blend mode; returns it.
    fn colours(&mut self, layers: &[Vec<u32>]) -> Vec<u32> {
        let of_eight = [
            (1.0, 1.0, Blend::Normal),
            (2.0, 0.8, Blend::Normal),
            (1.0, 0.5, Blend::Multiply),
            (1.0, 1.0, Blend::Multiply),
            (1.0, 0.3, Blend::Screen),
            (0.5, 0.6, Blend::Add),
            (4.0, 0.2, Blend::Add),
            (1.0, 0.7, Blend::Normal),
        ];
        let run = cpu::fuse_colour::run;
        // Aspect and radar alone, with holes and flat ground where neither covers.
        let of_two = fusion(&[(1.0, 0.4, Blend::Normal), (1.0, 0.6, Blend::Screen)]);
        let two = [&layers[7][..], &layers[3][..]];
        self.slot(Stage::FuseColour, Unit::Codes, &of_two, &two, run);
        let from = |order: [usize; 8]| order.map(|layer| &layers[layer][..]);
        // Ramp, imagery; shade, slope; radar; aspect, imagery; isolines on top; then as it comes.
        let first = from([0, 6, 4, 2, 8, 3, 5, 1]);
        let second = from([9, 7, 1, 3, 0, 2, 8, 4]);
        self.slot(
            Stage::FuseColour,
            Unit::Codes,
            &fusion(&of_eight),
            &second,
            run,
        );
        self.slot(
            Stage::FuseColour,
            Unit::Codes,
            &fusion(&of_eight),
            &first,
            run,
        )
    }
}
