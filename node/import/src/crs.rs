//! Coordinate systems of sources: from latitude and longitude to the source's own x and y, and back.
//! In: an EPSG number, a PROJ string, or "degrees". Out: a transform and its inverse. Datum shifts are those that
//! `proj4rs` computes without grid files; a system that needs more is refused. It knows no pixels.

use geodesy::Ellipsoid;
use proj4rs::Proj;
use proj4rs::transform::transform;

/// A coordinate system of a source.
pub(crate) struct Crs {
    name: String,
    method: Method,
}

enum Method {
    /// x is longitude, y latitude, both in degrees, on the planet's own ellipsoid.
    Degrees,
    /// A projection, or degrees on another datum.
    Proj { planet: Box<Proj>, own: Box<Proj> },
}

/// Why a coordinate system was refused; a clause without a full stop.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct CrsProblem(pub(crate) String);

const WGS84: &str = "+proj=longlat +datum=WGS84 +no_defs";

impl Crs {
    /// Longitude and latitude in degrees on the planet.
    pub(crate) fn degrees() -> Self {
        Self {
            name: "longitude and latitude".to_owned(),
            method: Method::Degrees,
        }
    }

    /// What a user wrote: `EPSG:number` or a PROJ string.
    pub(crate) fn parse(text: &str, planet: &Ellipsoid) -> Result<Self, CrsProblem> {
        let text = text.trim();
        if text.starts_with('+') {
            return Self::from_proj(text, text, planet);
        }
        let number = text
            .strip_prefix("EPSG:")
            .or_else(|| text.strip_prefix("epsg:"));
        match number.map(str::parse::<u32>) {
            Some(Ok(code)) => Self::from_epsg(code, planet),
            _ => Err(CrsProblem(format!(
                "\"{text}\" is no coordinate system: write EPSG:4326 or a PROJ string that begins with +proj="
            ))),
        }
    }

    /// An EPSG number.
    pub(crate) fn from_epsg(code: u32, planet: &Ellipsoid) -> Result<Self, CrsProblem> {
        let definition = u16::try_from(code)
            .ok()
            .and_then(crs_definitions::from_code);
        let Some(definition) = definition else {
            return Err(CrsProblem(format!(
                "the coordinate system EPSG:{code} is not known"
            )));
        };
        Self::from_proj(definition.proj4, &format!("EPSG:{code}"), planet)
    }

    /// A PROJ string. Projections between +proj=longlat on the planet and this are left to `proj4rs`.
    pub(crate) fn from_proj(
        text: &str,
        name: &str,
        planet: &Ellipsoid,
    ) -> Result<Self, CrsProblem> {
        let refuse = |why: &str| Err(CrsProblem(format!("the coordinate system {name} {why}")));
        let mut kept = Vec::new();
        for word in text.split_whitespace() {
            // "@null" says: take the angles as they are. Without a datum proj4rs does just that.
            if word == "+nadgrids=@null" || word == "+wktext" || word == "+type=crs" {
                continue;
            }
            if word.starts_with("+nadgrids=") || word == "+datum=NAD27" {
                return refuse("needs a datum grid file, which this program does not have");
            }
            if word.starts_with("+axis=") {
                return refuse("has axes that do not point east and north");
            }
            if word.starts_with("+geoidgrids=") {
                continue;
            }
            kept.push(word);
        }
        let method = |key: &str| kept.iter().find_map(|word| word.strip_prefix(key));
        let Some(projection) = method("+proj=") else {
            return refuse("has no +proj=");
        };
        let geographic = matches!(projection, "longlat" | "latlong" | "lonlat" | "latlon");
        let earth = *planet == Ellipsoid::EARTH;
        let shifts = kept.iter().any(|word| {
            word.strip_prefix("+towgs84=")
                .is_some_and(|shift| shift.split(',').any(|part| part.parse::<f64>() != Ok(0.0)))
                || word
                    .strip_prefix("+datum=")
                    .is_some_and(|d| !matches!(d, "WGS84" | "NAD83"))
        });
        let greenwich = method("+pm=").is_none_or(|meridian| meridian == "greenwich");
        if geographic && greenwich && !(shifts && earth) {
            return Ok(Self {
                name: name.to_owned(),
                method: Method::Degrees,
            });
        }
        if projection == "geocent" {
            return refuse("is geocentric; a raster needs a map projection");
        }
        let own = match Proj::from_proj_string(&kept.join(" ")) {
            Ok(own) => own,
            Err(error) => return refuse(&format!("cannot be used: {error}")),
        };
        // On another planet no datum of the Earth applies: without one, proj4rs shifts nothing.
        let base = if earth {
            WGS84.to_owned()
        } else {
            format!(
                "+proj=longlat +a={} +b={} +no_defs",
                planet.semi_major_m, planet.semi_minor_m
            )
        };
        let planet = match Proj::from_proj_string(&base) {
            Ok(planet) => planet,
            Err(error) => return refuse(&format!("cannot be used: {error}")),
        };
        let (planet, own) = (Box::new(planet), Box::new(own));
        Ok(Self {
            name: name.to_owned(),
            method: Method::Proj { planet, own },
        })
    }

    /// The name for messages: `EPSG:32630`.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// True where x is a longitude and y a latitude in degrees.
    pub(crate) fn is_geographic(&self) -> bool {
        match &self.method {
            Method::Degrees => true,
            Method::Proj { own, .. } => own.is_latlong(),
        }
    }

    /// True where no projection stands between the planet's angles and x and y.
    pub(crate) fn is_plain_degrees(&self) -> bool {
        matches!(self.method, Method::Degrees)
    }

    /// x and y of a latitude and longitude in degrees; `None` where the projection has no such point.
    pub(crate) fn forward(&self, latitude_deg: f64, longitude_deg: f64) -> Option<(f64, f64)> {
        match &self.method {
            Method::Degrees => Some((longitude_deg, latitude_deg)),
            Method::Proj { planet, own } => {
                let mut point = (longitude_deg.to_radians(), latitude_deg.to_radians(), 0.0);
                transform(planet, own, &mut point).ok()?;
                let (x, y) = if own.is_latlong() {
                    (point.0.to_degrees(), point.1.to_degrees())
                } else {
                    (point.0, point.1)
                };
                (x.is_finite() && y.is_finite()).then_some((x, y))
            }
        }
    }

    /// Latitude and longitude in degrees of x and y; `None` where there is no such point.
    pub(crate) fn inverse(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        match &self.method {
            Method::Degrees => (y.abs() <= 90.0 + 1e-9).then_some((y.clamp(-90.0, 90.0), x)),
            Method::Proj { planet, own } => {
                let mut point = if own.is_latlong() {
                    (x.to_radians(), y.to_radians(), 0.0)
                } else {
                    (x, y, 0.0)
                };
                transform(own, planet, &mut point).ok()?;
                let (latitude, longitude) = (point.1.to_degrees(), point.0.to_degrees());
                (latitude.is_finite() && longitude.is_finite()).then_some((latitude, longitude))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
    use super::*;

    // PYPROJ_TABLE: EPSG number, latitude, longitude, x, y by PROJ (pyproj, always_xy, from EPSG:4326).
    const PROJ: &[(u32, f64, f64, f64, f64)] = &include!("../tests/data/proj_values.in");

    #[test]
    fn transforms_agree_with_proj() {
        for &(code, latitude, longitude, x, y) in PROJ {
            let crs = Crs::from_epsg(code, &Ellipsoid::EARTH).unwrap();
            let (own_x, own_y) = crs.forward(latitude, longitude).unwrap();
            let tolerance = if crs.is_geographic() { 1e-9 } else { 1e-3 };
            assert!(
                (own_x - x).abs() < tolerance && (own_y - y).abs() < tolerance,
                "EPSG:{code}: {own_x}, {own_y}"
            );
            let (back_latitude, back_longitude) = crs.inverse(own_x, own_y).unwrap();
            assert!((back_latitude - latitude).abs() < 1e-8, "EPSG:{code}");
            assert!((back_longitude - longitude).abs() < 1e-8, "EPSG:{code}");
        }
    }

    #[test]
    fn systems_that_need_grids_or_odd_axes_are_refused() {
        for text in [
            "EPSG:4267",
            "EPSG:99999999",
            "EPSG:4978",
            "WGS84",
            "+proj=utm +zone=33 +axis=wsu",
        ] {
            assert!(Crs::parse(text, &Ellipsoid::EARTH).is_err(), "{text}");
        }
    }

    #[test]
    fn another_planet_takes_angles_as_they_are() {
        let crs = Crs::parse("+proj=eqc +R=1737400 +units=m", &Ellipsoid::MOON).unwrap();
        let (x, y) = crs.forward(45.0, 90.0).unwrap();
        assert!((x - 1_737_400.0 * std::f64::consts::FRAC_PI_2).abs() < 1e-6);
        assert!((y - 1_737_400.0 * std::f64::consts::FRAC_PI_4).abs() < 1e-6);
    }
}
