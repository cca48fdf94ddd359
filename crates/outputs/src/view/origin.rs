//! The admission to the WebSocket: this server's page, programs, and the pages that the user admits.

use std::net::IpAddr;
use std::str::FromStr;

use bench_dragon_messages::sentence::Expected;

/// The origin of an admitted page, as browsers send it in `Origin`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct AllowedOrigin(String);

impl FromStr for AllowedOrigin {
    type Err = Expected;

    /// Parses an origin, with or without a slash at the end, with or without the scheme's usual port.
    fn from_str(text: &str) -> Result<Self, Expected> {
        let refused = || Expected("an origin such as https://show.example or http://localhost:5173, or null".into());
        let plain = text.trim().to_ascii_lowercase();
        if plain == "null" {
            return Ok(Self(plain));
        }
        let (scheme, rest) = plain.split_once("://").ok_or_else(refused)?;
        let host = rest.strip_suffix('/').unwrap_or(rest);
        let usual_port = match scheme {
            "http" => ":80",
            "https" => ":443",
            _ => "",
        };
        let host = host.strip_suffix(usual_port).unwrap_or(host);
        let is_scheme =
            !scheme.is_empty() && scheme.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"+-.".contains(&byte));
        let is_host =
            !host.is_empty() && host.bytes().all(|byte| byte.is_ascii_alphanumeric() || b"-._:[]".contains(&byte));
        if is_scheme && is_host { Ok(Self(format!("{scheme}://{host}"))) } else { Err(refused()) }
    }
}

/// The admitted pages.
#[derive(Debug, Clone, Default)]
pub(crate) struct Admission {
    /// True if the server listens on a loopback address.
    pub(crate) loopback: bool,
    /// The admitted origins of other pages.
    pub(crate) origins: Vec<AllowedOrigin>,
}

impl Admission {
    /// Returns true if a WebSocket may be opened: by an admitted page, by this server's page, or by a program, which
    /// sends no origin.
    ///
    /// This server's page is a page over http whose origin is the requested host. Behind a proxy with TLS the page's
    /// origin begins with https. The proxy's headers are not trusted, since any client can send them: such an origin
    /// must be admitted by name.
    pub(crate) fn allows(&self, origin: Option<&str>, host: Option<&str>) -> bool {
        if origin.is_some_and(|origin| self.origins.iter().any(|allowed| allowed.0.eq_ignore_ascii_case(origin))) {
            return true;
        }
        let own = |origin: &str| {
            origin.strip_prefix("http://").is_some_and(|o| host.is_some_and(|h| o.eq_ignore_ascii_case(h)))
        };
        origin.is_none_or(own) && self.allows_host(host)
    }

    /// Returns true if a request for this host is meant for this server. On loopback the host must be a loopback name:
    /// otherwise a foreign name that resolves to this machine would be accepted.
    pub(crate) fn allows_host(&self, host: Option<&str>) -> bool {
        host.is_some_and(|host| !self.loopback || is_loopback_name(host))
    }
}

fn is_loopback_name(host: &str) -> bool {
    let bare = match host.rsplit_once(':') {
        Some((name, port)) if port.bytes().all(|byte| byte.is_ascii_digit()) => name,
        _ => host,
    };
    let address = bare.trim_start_matches('[').trim_end_matches(']').parse::<IpAddr>();
    bare.eq_ignore_ascii_case("localhost") || address.is_ok_and(|address| address.is_loopback())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn allows(origins: &[&str], origin: Option<&str>, host: Option<&str>, loopback: bool) -> bool {
        let origins = origins.iter().map(|origin| origin.parse().unwrap()).collect();
        Admission { loopback, origins }.allows(origin, host)
    }

    #[test]
    fn only_our_own_page_and_programs_may_watch() {
        assert!(allows(&[], Some("http://127.0.0.1:8080"), Some("127.0.0.1:8080"), true));
        assert!(allows(&[], Some("http://[::1]:8080"), Some("[::1]:8080"), true));
        assert!(allows(&[], None, Some("localhost:8080"), true));
        assert!(allows(&[], Some("http://10.1.2.3:8080"), Some("10.1.2.3:8080"), false));
        assert!(!allows(&[], Some("http://evil.example"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&[], Some("http://127.0.0.1:9"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&[], Some("http://evil.example:8080"), Some("evil.example:8080"), true));
        assert!(!allows(&[], Some("http://evil.example"), Some("10.1.2.3:8080"), false));
        assert!(!allows(&[], Some("https://10.1.2.3:8080"), Some("10.1.2.3:8080"), false));
        assert!(!allows(&[], Some("null"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&[], None, None, true));
    }

    #[test]
    fn a_page_that_is_let_in_may_watch_and_no_other() {
        let let_in = ["https://Show.example/", "http://localhost:5173"];
        assert!(allows(&let_in, Some("https://show.example"), Some("127.0.0.1:8080"), true));
        assert!(allows(&let_in, Some("https://show.example"), Some("show.example"), true));
        assert!(allows(&let_in, Some("http://localhost:5173"), Some("localhost:8080"), true));
        assert!(allows(&["https://show.example:443"], Some("https://show.example"), Some("show.example"), false));
        assert!(allows(&["null"], Some("null"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&let_in, Some("http://show.example"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&let_in, Some("https://show.example.evil"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&let_in, Some("null"), Some("127.0.0.1:8080"), true));
        assert!(!allows(&let_in, None, Some("show.example"), true), "a program still names this machine");
    }

    #[test]
    fn what_is_no_origin_is_refused() {
        for text in [
            "",
            "*",
            "show.example",
            "https://",
            "https://show.example/page",
            "https://*.example",
            "://x",
            "https://a b",
        ] {
            assert!(text.parse::<AllowedOrigin>().is_err(), "{text}");
        }
    }
}
