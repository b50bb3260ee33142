//! Where things are on a planet: ellipsoids, the six-face quadtree addressing of S2 read as geodetic
//! normals, lattice nodes shared between tiles, local frames, bounds and horizons.
//!
//! In: latitudes, longitudes, heights, tile addresses. Out: the same in another form. All in f64 and
//! integers; only [`frame`] turns f64 into f32 and into fixed point. It knows no file, clock, GPU or peer.

mod bounds;
mod circle;
mod cube;
mod ellipsoid;
pub mod frame;
mod horizon;
mod lattice;
mod tile;

pub use bounds::{Ball, TileHull};
pub use circle::{Circle, CircleError, CirclePolynomial, MAX_CIRCLE_RADIUS_M, Relation};
pub use cube::{FACES, Face, st_to_uv, uv_to_st};
pub use ellipsoid::{Ellipsoid, EllipsoidError, Geodetic};
pub use horizon::Horizon;
pub use lattice::{
    BORDER, CELLS, LATTICE_BITS, LatticePoint, MAX_POINT_LEVEL, NODES, STORED_NODES, TilePosition,
};
pub use tile::{Direction, MAX_LEVEL, Tile, TileError};
