//! Datagrams over UDP and IPv4. In: bytes. Out: datagrams, and a line in the log when a destination fails or works
//! again.
//!
//! A receiver that is gone causes no error here, because the socket is not connected.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4, ToSocketAddrs, UdpSocket};

use socket2::{Domain, Protocol, Socket, Type};

use bench_dragon_messages::sentence::Expected;

/// The route of datagrams out of this machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Route {
    /// The address of the interface by which they leave; `None` leaves it to the machine's routes.
    pub interface: Option<Ipv4Addr>,
    /// The most routers on the way of a multicast datagram, plus one.
    pub multicast_ttl: u32,
}

/// The reason why no datagram can be sent.
#[derive(Debug, thiserror::Error)]
pub enum NetworkError {
    /// The interface is not of this machine.
    #[error("no interface of this machine has the address {0}, expected one that `ip -4 address` lists")]
    Interface(Ipv4Addr),
    /// No socket can be opened.
    #[error("no UDP socket can be opened: {0}")]
    Socket(#[from] std::io::Error),
}

/// A socket for datagrams.
#[derive(Debug)]
pub struct Outlet {
    socket: UdpSocket,
    destinations: Vec<Destination>,
    sent: u64,
    unsent: u64,
}

#[derive(Debug)]
struct Destination {
    address: SocketAddrV4,
    /// True if the latest datagram was not sent.
    failing: bool,
}

impl Outlet {
    /// Opens a socket for all of these destinations.
    ///
    /// # Errors
    /// [`NetworkError`] for an interface that is not of this machine.
    pub fn open(destinations: &[SocketAddrV4], route: Route) -> Result<Self, NetworkError> {
        let socket = Socket::new(Domain::IPV4, Type::DGRAM, Some(Protocol::UDP))?;
        let own = route.interface.unwrap_or(Ipv4Addr::UNSPECIFIED);
        socket.bind(&SocketAddrV4::new(own, 0).into()).map_err(|error| match route.interface {
            Some(interface) if error.kind() == std::io::ErrorKind::AddrNotAvailable => {
                NetworkError::Interface(interface)
            }
            _ => NetworkError::Socket(error),
        })?;
        if let Some(interface) = route.interface {
            socket.set_multicast_if_v4(&interface)?;
        }
        socket.set_multicast_ttl_v4(route.multicast_ttl)?;
        // A receiver may run on this machine.
        socket.set_multicast_loop_v4(true)?;
        socket.set_broadcast(true)?;
        let destinations =
            destinations.iter().map(|address| Destination { address: *address, failing: false }).collect();
        Ok(Self { socket: socket.into(), destinations, sent: 0, unsent: 0 })
    }

    /// Sends a datagram to every destination. Counts failures; the log has the first failure and its end.
    pub fn send(&mut self, datagram: &[u8]) {
        for destination in &mut self.destinations {
            let address = destination.address;
            let failure = self.socket.send_to(datagram, address).err();
            match (&failure, destination.failing) {
                (Some(error), false) => log::warn!("cannot send to {address} ({error}); sending is tried again"),
                (None, true) => log::warn!("sending to {address} works again"),
                _ => (),
            }
            destination.failing = failure.is_some();
            *(if failure.is_none() { &mut self.sent } else { &mut self.unsent }) += 1;
        }
    }

    /// Returns the number of datagrams sent so far, to all destinations together.
    pub fn sent(&self) -> u64 {
        self.sent
    }

    /// Returns the number of datagrams that could not be sent.
    pub fn unsent(&self) -> u64 {
        self.unsent
    }
}

/// A text that names no destination.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum DestinationError {
    /// The text has another form.
    #[error(transparent)]
    Form(Expected),
    /// There is no host of this name.
    #[error("{0:?} is the name of no host, {1}")]
    NoHost(String, Expected),
    /// The host of this name has no IPv4 address.
    #[error("{0:?} has no IPv4 address, {1}")]
    NoAddress(String, Expected),
}

/// Returns the address of `HOST:PORT`, or of `HOST` if there is a usual port.
///
/// # Errors
/// The text names no IPv4 address.
pub fn destination(text: &str, usual_port: Option<u16>) -> Result<SocketAddrV4, DestinationError> {
    let form = if usual_port.is_some() { "an address such as 10.0.0.5 or desk.local:56565" } else { "HOST:PORT" };
    let expected = Expected(form.into());
    let (host, port) = match text.rsplit_once(':') {
        Some((host, port)) => (host, port.parse().ok()),
        None => (text, usual_port),
    };
    let Some(port) = port.filter(|port| *port > 0) else { return Err(DestinationError::Form(expected)) };
    let Ok(addresses) = (host, port).to_socket_addrs() else {
        return Err(DestinationError::NoHost(host.to_owned(), expected));
    };
    let of_v4 = |address| if let SocketAddr::V4(address) = address { Some(address) } else { None };
    addresses.filter_map(of_v4).next().ok_or_else(|| DestinationError::NoAddress(host.to_owned(), expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_destination_has_a_host_and_a_port() {
        let found = |text, port| destination(text, port).map(|address| address.to_string());
        assert_eq!(found("10.0.0.5", Some(56565)).as_deref(), Ok("10.0.0.5:56565"));
        assert_eq!(found("10.0.0.5:7", Some(56565)).as_deref(), Ok("10.0.0.5:7"));
        assert_eq!(found("localhost:9000", None).as_deref(), Ok("127.0.0.1:9000"));
        for (text, port) in
            [("10.0.0.5", None), ("10.0.0.5:0", None), ("10.0.0.5:x", None), ("", Some(1)), ("::1", Some(1))]
        {
            assert!(found(text, port).unwrap_err().to_string().contains("expected "), "{text}");
        }
    }
}
