//! The georeference of a GeoTIFF (OGC 19-008r4): its tags and keys, read into an affine map and a coordinate system.
//! In: the six tags as numbers and text. Out: where raster space lies. What the keys do not say with certainty is
//! refused, never guessed.

use geodesy::Ellipsoid;

use crate::crs::{Crs, CrsProblem};
use crate::grid::Affine;

/// The tags that carry a georeference, as found in a TIFF directory.
#[derive(Clone, Debug, Default)]
pub(crate) struct GeoTags {
    /// 33550: size of a pixel.
    pub(crate) pixel_scale: Vec<f64>,
    /// 33922: raster and model coordinates of points, six numbers each.
    pub(crate) tie_points: Vec<f64>,
    /// 34264: a 4×4 matrix.
    pub(crate) transformation: Vec<f64>,
    /// 34735: the keys.
    pub(crate) directory: Vec<u16>,
    /// 34736: numbers that keys refer to.
    pub(crate) doubles: Vec<f64>,
    /// 34737: text that keys refer to.
    pub(crate) ascii: String,
}

/// Keys by number (OGC 19-008r4, annex B).
mod key {
    pub(super) const MODEL_TYPE: u16 = 1024;
    pub(super) const RASTER_TYPE: u16 = 1025;
    pub(super) const CITATION: u16 = 1026;
    pub(super) const GEODETIC_CRS: u16 = 2048;
    pub(super) const GEODETIC_DATUM: u16 = 2050;
    pub(super) const ANGULAR_UNITS: u16 = 2054;
    pub(super) const ELLIPSOID: u16 = 2056;
    pub(super) const SEMI_MAJOR: u16 = 2057;
    pub(super) const SEMI_MINOR: u16 = 2058;
    pub(super) const INVERSE_FLATTENING: u16 = 2059;
    pub(super) const PRIME_MERIDIAN: u16 = 2051;
    pub(super) const PRIME_MERIDIAN_LONGITUDE: u16 = 2061;
    pub(super) const PROJECTED_CRS: u16 = 3072;
    pub(super) const PROJECTION: u16 = 3074;
    pub(super) const PROJECTION_METHOD: u16 = 3075;
    pub(super) const LINEAR_UNITS: u16 = 3076;
    pub(super) const LINEAR_UNIT_SIZE: u16 = 3077;
    pub(super) const VERTICAL_UNITS: u16 = 4099;
}

/// "The value is given by other keys."
const USER_DEFINED: u32 = 32767;
const METRES_A_FOOT: f64 = 0.3048;
const METRES_A_SURVEY_FOOT: f64 = 1200.0 / 3937.0;

impl GeoTags {
    /// Whether there is any georeference at all.
    pub(crate) fn are_present(&self) -> bool {
        !self.transformation.is_empty() || !self.tie_points.is_empty()
    }

    fn entry(&self, wanted: u16) -> Option<&[u16]> {
        let entries = self.directory.get(4..)?;
        entries
            .chunks_exact(4)
            .find(|entry| entry.first() == Some(&wanted))
    }

    fn code(&self, wanted: u16) -> Option<u32> {
        match self.entry(wanted)? {
            [_, 0, _, value] => Some(u32::from(*value)),
            _ => None,
        }
    }

    fn number(&self, wanted: u16) -> Option<f64> {
        match self.entry(wanted)? {
            [_, 34736, _, at] => self.doubles.get(usize::from(*at)).copied(),
            [_, 0, _, value] => Some(f64::from(*value)),
            _ => None,
        }
    }

    fn text(&self, wanted: u16) -> Option<&str> {
        match self.entry(wanted)? {
            [_, 34737, count, at] => {
                let start = usize::from(*at);
                let text = self.ascii.get(start..start + usize::from(*count))?;
                Some(text.trim_end_matches(['|', '\0']))
            }
            _ => None,
        }
    }

    /// True where raster coordinates name samples (PixelIsPoint), false where they name corners of cells.
    pub(crate) fn pixel_is_point(&self) -> bool {
        self.code(key::RASTER_TYPE) == Some(2)
    }

    /// Metres a vertical unit; 1 where nothing is said.
    pub(crate) fn vertical_unit_m(&self) -> f64 {
        match self.code(key::VERTICAL_UNITS) {
            Some(9002) => METRES_A_FOOT,
            Some(9003) => METRES_A_SURVEY_FOOT,
            _ => 1.0,
        }
    }

    /// From raster coordinates to model coordinates. Fails with a clause.
    pub(crate) fn affine(&self) -> Result<Affine, String> {
        if let [a, b, _, d, e, f, _, h, ..] = self.transformation[..]
            && self.transformation.len() >= 16
        {
            let affine = Affine {
                x0: d,
                dx_column: a,
                dx_row: b,
                y0: h,
                dy_column: e,
                dy_row: f,
            };
            return Ok(affine);
        }
        match (&self.pixel_scale[..], &self.tie_points[..]) {
            ([sx, sy, ..], [i, j, _, x, y, _, ..]) => {
                let origin = Affine {
                    x0: *x,
                    dx_column: *sx,
                    dx_row: 0.0,
                    y0: *y,
                    dy_column: 0.0,
                    dy_row: -*sy,
                };
                Ok(origin.moved(-i, -j))
            }
            ([], [_, ..]) => Err("it is placed by ground control points, not by a grid".to_owned()),
            _ => Err("it has no georeference".to_owned()),
        }
    }

    /// The coordinate system that the keys name.
    pub(crate) fn crs(&self, planet: &Ellipsoid) -> Result<Crs, CrsProblem> {
        let problem = |text: String| Err(CrsProblem(text));
        match self.code(key::MODEL_TYPE) {
            Some(3) => problem("its coordinate system is geocentric".to_owned()),
            Some(2) => self.geographic(planet),
            Some(1) | None if self.code(key::PROJECTED_CRS).is_some() => self.projected(planet),
            None if self.code(key::GEODETIC_CRS).is_some() => self.geographic(planet),
            Some(1) => problem(format!(
                "its keys do not say which projection it has ({})",
                self.text(key::CITATION).unwrap_or("no name given")
            )),
            _ => problem("it does not say which coordinate system it has".to_owned()),
        }
    }

    fn geographic(&self, planet: &Ellipsoid) -> Result<Crs, CrsProblem> {
        let base = self.base()?;
        let name = match self.code(key::GEODETIC_CRS) {
            Some(code) if code != USER_DEFINED => format!("EPSG:{code}"),
            _ => self.text(key::CITATION).unwrap_or("of its own").to_owned(),
        };
        Crs::from_proj(&format!("+proj=longlat {base} +no_defs"), &name, planet)
    }

    /// The ellipsoid and datum below a user-defined system, as PROJ words.
    fn base(&self) -> Result<String, CrsProblem> {
        if let Some(unit) = self.code(key::ANGULAR_UNITS)
            && unit != 9102
        {
            return Err(CrsProblem(format!(
                "its angles are not in degrees (unit {unit})"
            )));
        }
        if let Some(code) = self.code(key::GEODETIC_CRS)
            && code != USER_DEFINED
        {
            let definition = u16::try_from(code)
                .ok()
                .and_then(crs_definitions::from_code);
            let Some(definition) = definition else {
                return Err(CrsProblem(format!(
                    "the coordinate system EPSG:{code} is not known"
                )));
            };
            let words = definition.proj4.split_whitespace();
            if definition.proj4.starts_with("+proj=longlat") {
                let kept = words.filter(|w| !w.starts_with("+proj=") && *w != "+no_defs");
                return Ok(kept.collect::<Vec<_>>().join(" "));
            }
            return Err(CrsProblem(format!(
                "EPSG:{code} is not geographic, but stands as its base"
            )));
        }
        let meridian = self.code(key::PRIME_MERIDIAN);
        let off = self.number(key::PRIME_MERIDIAN_LONGITUDE).unwrap_or(0.0);
        if !matches!(meridian, None | Some(8901 | USER_DEFINED)) || off != 0.0 {
            return Err(CrsProblem("its prime meridian is not Greenwich".to_owned()));
        }
        match self.code(key::GEODETIC_DATUM) {
            Some(6326) => return Ok("+datum=WGS84".to_owned()),
            Some(6269) => return Ok("+datum=NAD83".to_owned()),
            Some(6258 | 6171) => return Ok("+ellps=GRS80 +towgs84=0,0,0,0,0,0,0".to_owned()),
            Some(code) if code != USER_DEFINED => {
                return Err(CrsProblem(format!(
                    "its datum EPSG:{code} is not known here"
                )));
            }
            _ => {}
        }
        // An ellipsoid without a datum: its angles are taken as they are.
        if let Some(a) = self.number(key::SEMI_MAJOR) {
            if let Some(b) = self.number(key::SEMI_MINOR) {
                return Ok(format!("+a={a} +b={b}"));
            }
            return match self.number(key::INVERSE_FLATTENING) {
                Some(flattening) if flattening > 1.0 => Ok(format!("+a={a} +rf={flattening}")),
                Some(_) => Ok(format!("+a={a} +b={a}")),
                None => Err(CrsProblem("its ellipsoid has no polar radius".to_owned())),
            };
        }
        match self.code(key::ELLIPSOID) {
            Some(7030) => Ok("+ellps=WGS84".to_owned()),
            Some(7019) => Ok("+ellps=GRS80".to_owned()),
            Some(code) => Err(CrsProblem(format!(
                "its ellipsoid EPSG:{code} is not known here"
            ))),
            None => Err(CrsProblem("its keys name no ellipsoid".to_owned())),
        }
    }

    fn projected(&self, planet: &Ellipsoid) -> Result<Crs, CrsProblem> {
        if let Some(code) = self.code(key::PROJECTED_CRS)
            && code != USER_DEFINED
        {
            return Crs::from_epsg(code, planet);
        }
        let name = self
            .text(key::CITATION)
            .unwrap_or("of its own")
            .trim()
            .to_owned();
        let unit = match (
            self.code(key::LINEAR_UNITS),
            self.number(key::LINEAR_UNIT_SIZE),
        ) {
            (None | Some(9001), _) => 1.0,
            (Some(9002), _) => METRES_A_FOOT,
            (Some(9003), _) => METRES_A_SURVEY_FOOT,
            (Some(USER_DEFINED), Some(size)) if size > 0.0 => size,
            (Some(unit), _) => {
                return Err(CrsProblem(format!(
                    "its unit of length EPSG:{unit} is not known here"
                )));
            }
        };
        let base = self.base()?;
        let method = match self.code(key::PROJECTION) {
            Some(code @ 16001..=16060) => format!("+proj=utm +zone={}", code - 16000),
            Some(code @ 16101..=16160) => format!("+proj=utm +zone={} +south", code - 16100),
            Some(code) if code != USER_DEFINED => {
                return Err(CrsProblem(format!(
                    "its projection EPSG:{code} is not known here"
                )));
            }
            _ => self.method(&name, unit)?,
        };
        let text = format!("{method} {base} +to_meter={unit} +no_defs");
        Crs::from_proj(&text, &name, planet)
    }

    /// A user-defined projection by its method and parameters.
    fn method(&self, name: &str, unit: f64) -> Result<String, CrsProblem> {
        // The first of several keys that writers use for one parameter; none of them: its neutral value.
        let first = |keys: &[u16], neutral: f64| {
            keys.iter()
                .find_map(|key| self.number(*key))
                .unwrap_or(neutral)
        };
        let longitude = first(&[3080, 3084, 3088, 3095], 0.0);
        let latitude = first(&[3081, 3085, 3089], 0.0);
        let x = first(&[3082, 3086, 3090], 0.0) * unit;
        let y = first(&[3083, 3087, 3091], 0.0) * unit;
        let scale = first(&[3092, 3093], 1.0);
        let (first_parallel, second_parallel) = (self.number(3078), self.number(3079));
        let offsets = format!("+lon_0={longitude} +x_0={x} +y_0={y}");
        let parallels = |name: &str| match (first_parallel, second_parallel) {
            (Some(a), Some(b)) => Ok(format!(
                "+proj={name} +lat_1={a} +lat_2={b} +lat_0={latitude}"
            )),
            _ => Err(CrsProblem(
                "its conic projection lacks a standard parallel".to_owned(),
            )),
        };
        let method = match self.code(key::PROJECTION_METHOD) {
            Some(1) => format!("+proj=tmerc +lat_0={latitude} +k={scale}"),
            Some(7) => match first_parallel {
                Some(parallel) => format!("+proj=merc +lat_ts={parallel}"),
                None => format!("+proj=merc +k={scale}"),
            },
            Some(8) => parallels("lcc")?,
            Some(9) => format!("+proj=lcc +lat_1={latitude} +lat_0={latitude} +k_0={scale}"),
            Some(10) => format!("+proj=laea +lat_0={latitude}"),
            Some(11) => parallels("aea")?,
            Some(15) if latitude.abs() == 90.0 => {
                format!("+proj=stere +lat_0={latitude} +k={scale}")
            }
            Some(15) if latitude != 0.0 => {
                // Here the "latitude of origin" is the latitude of true scale.
                format!(
                    "+proj=stere +lat_0={} +lat_ts={latitude}",
                    90.0_f64.copysign(latitude)
                )
            }
            Some(17) => format!(
                "+proj=eqc +lat_ts={} +lat_0={latitude}",
                first_parallel.unwrap_or(0.0)
            ),
            Some(24) => "+proj=sinu".to_owned(),
            Some(number) => {
                return Err(CrsProblem(format!(
                    "its user-defined projection {name} (method {number}) is not known here"
                )));
            }
            None => {
                return Err(CrsProblem(format!(
                    "its user-defined projection {name} has no method in the GeoTIFF keys"
                )));
            }
        };
        Ok(format!("{method} {offsets}"))
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    #[test]
    fn a_user_defined_albers_projection_is_read() {
        let tags = GeoTags {
            directory: vec![
                1, 1, 0, 12, 1024, 0, 1, 1, 1025, 0, 1, 1, 2048, 0, 1, 4326, 2054, 0, 1, 9102,
                3072, 0, 1, 32767, 3074, 0, 1, 32767, 3075, 0, 1, 11, 3076, 0, 1, 9001, 3078,
                34736, 1, 0, 3079, 34736, 1, 1, 3080, 34736, 1, 3, 3081, 34736, 1, 2,
            ],
            doubles: vec![29.5, 45.5, 23.0, -96.0],
            ..GeoTags::default()
        };
        let crs = tags.crs(&Ellipsoid::EARTH).unwrap();
        // PROJ: +proj=aea +lat_0=23 +lon_0=-96 +lat_1=29.5 +lat_2=45.5 +datum=WGS84
        let (x, y) = crs.forward(39.0, -105.5).unwrap();
        assert!((x + 813_760.923).abs() < 0.01, "{x}");
        assert!((y - 1_815_617.85).abs() < 0.01, "{y}");
    }

    #[test]
    fn what_is_not_certain_is_refused() {
        let keys = |directory: &[u16]| {
            let tags = GeoTags {
                directory: directory.to_vec(),
                ..GeoTags::default()
            };
            tags.crs(&Ellipsoid::EARTH).map(|crs| crs.name().to_owned())
        };
        assert!(keys(&[]).is_err());
        assert!(keys(&[1, 1, 0, 1, 1024, 0, 1, 3]).is_err());
        assert!(keys(&[1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32767]).is_err());
        // Grads.
        assert!(
            keys(&[
                1, 1, 0, 3, 1024, 0, 1, 2, 2048, 0, 1, 4326, 2054, 0, 1, 9105
            ])
            .is_err()
        );
        assert_eq!(
            keys(&[1, 1, 0, 2, 1024, 0, 1, 2, 2048, 0, 1, 4326]).unwrap(),
            "EPSG:4326"
        );
    }

    #[test]
    fn a_tie_point_need_not_be_the_corner() {
        let tags = GeoTags {
            pixel_scale: vec![2.0, 3.0, 0.0],
            tie_points: vec![10.0, 20.0, 0.0, 100.0, 200.0, 0.0],
            ..GeoTags::default()
        };
        let affine = tags.affine().unwrap();
        assert_eq!(affine.apply(10.0, 20.0), (100.0, 200.0));
        assert_eq!(affine.apply(0.0, 0.0), (80.0, 260.0));
    }
}
