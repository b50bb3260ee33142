//! Screens in a room, and what an eye needs to be shown on them: planes, cylinders, spheres and surfaces given by
//! points, pixel densities, and the planar views that cover a curved screen.
//!
//! In: measures in room metres (right-handed, x right, y up, z towards the viewers), canvas sizes, eyes. Out: room points,
//! rays' meetings, views. All in f64. It knows no file, wall, clock, GPU or peer.
//!
//! A place on a canvas is two shares 0…1 from its upper left corner: to the right, and down. Every canvas is right-handed
//! for its viewers: right × up points towards them.
//!
//! What runs in every frame ([`SampledMap::cover`]) takes the four basic operations and square roots, so that all
//! machines compute the same bits. Trigonometry stands only where equal angles are equal pixels (arcs, fisheyes, grids):
//! there machines may differ in the last bit, some 1e-12 of a pixel.

mod cover;
mod cylinder;
mod density;
mod error;
mod gather;
mod head;
mod jacobian;
mod patches;
mod planar;
mod points;
mod points_tree;
mod rays;
mod rim;
mod sampled;
mod shape;
mod sphere;
mod view;

pub use cover::{Cover, CoverLimits, Part};
pub use cylinder::{Cylinder, CylinderMapping};
pub use density::{Density, pixel_density, pixels_per_radian};
pub use error::ShapeError;
pub use head::{HeadPose, eyes};
pub use patches::Patch;
pub use planar::Planar;
pub use points::{Points, PointsAt};
pub use sampled::{MOST_MAP_PX, SampledMap};
pub use shape::Shape;
pub use sphere::{Sphere, SphereMapping};
pub use view::PlanarView;
