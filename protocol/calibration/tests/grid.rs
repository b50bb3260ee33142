//! Where samples lie on an output: hand-computed values for both placements, edges and holes, and for maps of light.
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]

use calibration::{Grid, Map, Placement, Texels};

/// 2 × 2: 0 and 1 above, 10 and 11 below.
fn small(placement: Placement) -> Grid<[f32; 1]> {
    Grid::new(2, 2, placement, vec![[0.0], [1.0], [10.0], [11.0]]).unwrap()
}

#[test]
fn samples_at_centres_lie_a_quarter_in() {
    let grid = small(Placement::Centres);
    // (column + ½) / 2 is ¼ and ¾.
    assert_eq!(grid.sample(0.25, 0.25), Some([0.0]));
    assert_eq!(grid.sample(0.75, 0.25), Some([1.0]));
    assert_eq!(grid.sample(0.25, 0.75), Some([10.0]));
    assert_eq!(grid.sample(0.5, 0.5), Some([5.5]));
    // Beyond the outermost samples the cell goes on: what is linear stays linear.
    assert_eq!(grid.sample(0.0, 0.25), Some([-0.5]));
    assert_eq!(grid.sample(1.0, 1.0), Some([16.5]));
}

#[test]
fn samples_on_corners_are_not_shifted_by_half_a_pixel() {
    let grid = small(Placement::Corners);
    assert_eq!(grid.sample(0.0, 0.0), Some([0.0]));
    assert_eq!(grid.sample(1.0, 0.0), Some([1.0]));
    assert_eq!(grid.sample(0.0, 1.0), Some([10.0]));
    assert_eq!(grid.sample(1.0, 1.0), Some([11.0]));
    // Pixel (0, 0) of an output of 4 × 4 has its centre at ⅛.
    assert_eq!(grid.sample(0.125, 0.125), Some([1.375]));
}

#[test]
fn a_corner_mesh_at_output_resolution_gives_each_pixel_its_own_place() {
    let corners = vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
    let grid = Grid::new(2, 2, Placement::Corners, corners).unwrap();
    let full = grid.resampled(1920, 1080).unwrap();
    assert_eq!(full.placement, Placement::Centres);
    for (column, row) in [(0, 0), (1919, 0), (960, 540), (1919, 1079)] {
        let [u, v] = full.at(column, row).unwrap();
        assert!((u * 1920.0 - (column as f32 + 0.5)).abs() < 1e-3);
        assert!((v * 1080.0 - (row as f32 + 0.5)).abs() < 1e-3);
    }
}

#[test]
fn a_coarse_grid_of_a_linear_mapping_is_exact_up_to_the_edge() {
    let share = |index: u32, size: u32| (index as f32 + 0.5) / size as f32;
    let values = (0..7)
        .flat_map(|row| (0..5).map(move |column| [share(column, 5), share(row, 7)]))
        .collect();
    let full = Grid::new(5, 7, Placement::Centres, values)
        .unwrap()
        .resampled(400, 300)
        .unwrap();
    for (index, [u, v]) in full.values.iter().enumerate() {
        let (column, row) = (index as u32 % 400, index as u32 / 400);
        assert!(
            (u - share(column, 400)).abs() < 1e-6,
            "{column}, {row}: {u}"
        );
        assert!((v - share(row, 300)).abs() < 1e-6, "{column}, {row}: {v}");
    }
}

#[test]
fn a_hole_reaches_as_far_as_it_counts() {
    let mut grid = small(Placement::Centres);
    grid.values[3] = [f32::NAN];
    assert_eq!(grid.sample(0.25, 0.25), Some([0.0]));
    assert_eq!(
        grid.sample(0.75, 0.25),
        Some([1.0]),
        "exactly on a sample, the neighbour does not count"
    );
    assert_eq!(grid.sample(0.5, 0.25), Some([0.5]));
    assert_eq!(grid.sample(0.5, 0.5), None);
    assert_eq!(grid.sample(0.75, 0.75), None);
}

#[test]
fn there_is_nothing_outside_and_nothing_where_no_number_is() {
    let grid = small(Placement::Centres);
    for share in [-1e-9, 1.0 + 1e-9, f64::NAN, f64::INFINITY] {
        assert_eq!(grid.sample(share, 0.5), None);
        assert_eq!(grid.sample(0.5, share), None);
    }
    assert_eq!(grid.at(2, 0), None);
    assert_eq!(grid.at(0, 2), None);
}

#[test]
fn a_single_sample_is_everywhere() {
    let grid = Grid::new(1, 1, Placement::Corners, vec![[7.0]]).unwrap();
    assert_eq!(grid.sample(0.0, 1.0), Some([7.0]));
    assert_eq!(grid.resampled(3, 2).unwrap().values, [[7.0]; 6]);
}

#[test]
fn a_grid_that_lies_about_its_size_is_none_and_never_panics() {
    assert!(Grid::new(2, 2, Placement::Centres, vec![[0.0]; 3]).is_none());
    assert!(Grid::<[f32; 1]>::new(0, 5, Placement::Centres, vec![]).is_none());
    assert!(Grid::new(16_385, 1, Placement::Centres, vec![[0.0]; 16_385]).is_none());
    let mut grid = small(Placement::Corners);
    grid.values.truncate(1);
    assert_eq!(grid.sample(1.0, 1.0), None);
    assert!(grid.resampled(0, 4).is_none());
    assert!(grid.resampled(4, 20_000).is_none());
}

#[test]
fn maps_of_light_go_on_beyond_their_outermost_pixels() {
    let map = Map::new(2, 1, Texels::Grey(vec![0.0, 1.0])).unwrap();
    assert_eq!(map.sample(0.0, 0.0), Some([0.0; 3]));
    assert_eq!(map.sample(0.25, 0.5), Some([0.0; 3]));
    assert_eq!(map.sample(0.5, 0.9), Some([0.5; 3]));
    assert_eq!(map.sample(1.0, 1.0), Some([1.0; 3]));
    assert_eq!(map.sample(1.1, 0.5), None);
    let colour = Map::new(1, 1, Texels::Colour(vec![[0.1, 0.2, 0.3]])).unwrap();
    assert_eq!(colour.sample(0.7, 0.2), Some([0.1, 0.2, 0.3]));
    assert!(Map::new(2, 2, Texels::Grey(vec![1.0; 5])).is_none());
}
