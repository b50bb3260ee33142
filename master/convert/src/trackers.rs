//! Addresses of VRPN devices.
//! In: what configurations write. Out: `DEVICE@HOST[:PORT]`, the way that wall files write. It connects to nothing.

use crate::draft::Builder;
use crate::source::At;

impl Builder {
    /// The address as wall files write it. `None`, and a line in the list, where it is none.
    pub(crate) fn vrpn_source(&mut self, at: At<'_>, address: &str) -> Option<String> {
        let (device, rest) = match address.split_once('@') {
            Some((device, rest)) => (device, rest),
            None => {
                self.ledger.note(
                    at,
                    format!("the VRPN device \"{address}\" without a host"),
                    "it is assumed on the machine of the master, localhost",
                    "write source = \"DEVICE@HOST\" with the host of the VRPN server",
                );
                (address, "localhost")
            }
        };
        let schemes = ["x-vrpn://", "x-vrpn:", "tcp://", "tcp:", "udp://", "udp:"];
        let scheme = schemes.iter().find(|scheme| rest.starts_with(**scheme));
        let host = scheme.map_or(rest, |scheme| rest.strip_prefix(*scheme).unwrap_or(rest));
        if let Some(scheme) = scheme {
            self.ledger.note(
                at,
                format!("{scheme} in a VRPN address"),
                "how the connection is made is agreed with the server",
                "nothing",
            );
        }
        let port_is_sound = match host.rsplit_once(':') {
            Some((_, port)) => port.parse::<u16>().is_ok_and(|port| port > 0),
            None => true,
        };
        let name = host.rsplit_once(':').map_or(host, |(name, _)| name);
        let plain = |text: &str| {
            !text.is_empty() && !text.chars().any(|c| c.is_whitespace() || c.is_control())
        };
        if plain(device) && plain(name) && port_is_sound && !name.contains(['/', '@']) {
            return Some(format!("{device}@{host}"));
        }
        self.ledger.note(
            at,
            format!("the VRPN address {}", crate::error::shown(address)),
            "it is not of the form DEVICE@HOST or DEVICE@HOST:PORT, so nothing tracks the observer",
            "write [[trackers]] by hand",
        );
        None
    }
}
