//! `view`: the live stage picture in a browser.

use std::io::{ErrorKind, IsTerminal};
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use bench_dragon::messages::hexadecimal;
use bench_dragon::outputs::view::{AllowedOrigin, Certificate, Facts, Proofs, Ready, ViewError, ViewOptions, serve};
use bench_dragon::proof::{Proved, Refused, scene_hash};
use serde::Serialize;
use serde_json::json;

use super::qr_code::qr_code;
use super::scene_facts::scene_facts;
use super::scene_frames::scene_frames;
use super::verify::certificate::reason;
use super::{CommandError, Common, Output, stop_on_signals};

/// Arguments of `view`.
#[derive(Debug, Clone, clap::Args)]
pub struct ViewArguments {
    /// The port of the page; 0 takes any free one
    #[arg(long, default_value_t = 8080)]
    port: u16,
    /// The address to listen on; any but loopback lets other machines watch
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Let browsers conduct the show: pause, seek, rate, hold
    #[arg(long)]
    control: bool,
    /// Admit pages of another origin, such as https://show.example or http://localhost:5173; may be repeated
    #[arg(long, value_name = "ORIGIN")]
    allow_origin: Vec<AllowedOrigin>,
    /// Serve the files of this folder below /pages/, for your own page
    #[arg(long, value_name = "DIR")]
    pages: Option<PathBuf>,
    /// A certificate of `events --certify`: checked while the page is served. If a publisher shows that scene, the page
    /// shows the proved results of its events; may be repeated
    #[arg(long, value_name = "FILE")]
    certificate: Vec<PathBuf>,
}

/// The line of `view --json`, and of `design --json`, once browsers can connect.
#[derive(Serialize)]
pub struct ReadyLine {
    pub r#type: &'static str,
    pub url: String,
    /// The addresses for other machines, if the server listens on all of this machine's.
    pub others: Vec<String>,
    /// The token for commands; null if none is needed.
    pub token: Option<String>,
}

/// Serves the picture until a signal comes.
pub fn view(common: &Common, arguments: &ViewArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let ViewArguments { port, listen, control, allow_origin, pages, certificate } = arguments.clone();
    let certificates = certificate.iter().map(|file| opened(file)).collect::<Result<Vec<_>, _>>()?;
    let proofs = Arc::new(Proofs::expected(&certificates));
    let address = SocketAddr::new(listen, port);
    let facts = Arc::new(Facts::new(scene_facts));
    let (origins, open_scene) = (allow_origin, scene_frames);
    let options = ViewOptions { address, control, origins, pages, proofs: Arc::clone(&proofs), facts, open_scene };
    serve(&common.names, options, &stop, |ready| {
        announce(common, arguments, ready)?;
        check_in_background(certificates, proofs, common.json)
    })
}

fn opened(file: &Path) -> Result<Certificate, CommandError> {
    Certificate::open(file).map_err(|refused| {
        let expected = match refused {
            Refused::Unreadable(_) => "",
            _ => ": expected a certificate as events --certify writes it",
        };
        CommandError::BadInput(reason(&file.display().to_string(), &refused) + expected)
    })
}

/// Checks certificates in order on a separate thread, which ends with the process.
fn check_in_background(certificates: Vec<Certificate>, proofs: Arc<Proofs>, json: bool) -> Result<(), CommandError> {
    if certificates.is_empty() {
        return Ok(());
    }
    std::thread::Builder::new().name("certificates".to_owned()).spawn(move || {
        for certificate in certificates {
            let shown = certificate.file().display().to_string();
            let checked = certificate.check();
            checked.iter().for_each(|proved| proofs.add(proved));
            // The reader of the output has closed it; the page continues.
            let _ = report(&shown, checked, json);
        }
    })?;
    Ok(())
}

/// Reports the result of checking a certificate.
fn report(shown: &str, checked: Result<Proved, Refused>, json: bool) -> Result<(), CommandError> {
    let mut output = Output::standard();
    match checked {
        Ok(proved) => {
            let scene = hexadecimal(&scene_hash(&proved.scene));
            if json {
                output
                    .json(&json!({"type": "certificate", "file": shown, "verdict": "proved", "scene_hash": scene}))?;
            } else {
                output.line(&format!("{shown} is valid, for the scene whose text has the BLAKE3 {scene}."))?;
            }
        }
        Err(refused) => {
            let sentence = reason(shown, &refused);
            log::error!("{sentence}: nothing is proved by this certificate");
            if json {
                let problem = json!({"type": "certificate", "file": shown, "verdict": "refused", "problem": sentence});
                output.json(&problem)?;
            }
        }
    }
    output.finish()
}

fn announce(common: &Common, arguments: &ViewArguments, ready: &Ready) -> Result<(), CommandError> {
    let Ready { address, ref token } = *ready;
    let port = address.port();
    let fragment = token.as_ref().map_or(String::new(), |token| format!("#token={}", token.as_str()));
    let others: Vec<_> = if address.ip().is_unspecified() { own_addresses(address.ip()) } else { Vec::new() };
    let others = others.into_iter().map(|ip| format!("http://{}/", SocketAddr::new(ip, port))).collect::<Vec<_>>();
    let mut output = Output::standard();
    if common.json {
        let (url, token) = (format!("http://{address}/"), token.as_ref().map(|token| token.as_str().to_owned()));
        output.json(&ReadyLine { r#type: "ready", url, others, token })?;
        return output.finish();
    }
    let (names, of_all) = (common.quoted_names(), address.ip().is_unspecified());
    if of_all {
        output.line(&format!(
            "The stage picture of {names} is at port {port} of every address of this machine; here, \
             http://localhost:{port}/{fragment}. Ctrl-C ends."
        ))?;
        others.iter().try_for_each(|url| output.line(&format!("  from elsewhere: {url}{fragment}")))?;
    } else {
        output.line(&format!("The stage picture of {names} is at http://{address}/{fragment}. Ctrl-C ends."))?;
    }
    if arguments.pages.is_some() {
        let host = if of_all { format!("localhost:{port}") } else { address.to_string() };
        output.line(&format!("Your own pages are at http://{host}/pages/."))?;
    }
    // A phone would have to type the token.
    let for_phones = if of_all { others.first().cloned() } else { Some(format!("http://{address}/")) };
    let is_reachable = !address.ip().is_loopback() && std::io::stdout().is_terminal();
    if let Some(code) = for_phones.filter(|_| is_reachable).and_then(|url| qr_code(&format!("{url}{fragment}"))) {
        output.line(&code)?;
    }
    if token.is_some() {
        output.line("Only who has this address with its token may conduct; without the token one may watch.")?;
    }
    if !address.ip().is_loopback() {
        eprintln!("WARNING: anyone who can reach {address} can watch this show; there is no password.");
    }
    output.finish()
}

/// Returns the addresses of this machine for other machines, of the kinds that are listened on.
pub fn own_addresses(listen: IpAddr) -> Vec<IpAddr> {
    let interfaces = nix::ifaddrs::getifaddrs().into_iter().flatten();
    let mut addresses: Vec<_> = interfaces
        .filter_map(|interface| {
            let address = interface.address?;
            let v4 = address.as_sockaddr_in().map(|address| IpAddr::V4(address.ip()));
            v4.or_else(|| address.as_sockaddr_in6().map(|address| IpAddr::V6(address.ip())))
        })
        .filter(|ip| !ip.is_loopback() && (ip.is_ipv4() || listen.is_ipv6()))
        // A link-local address would need the name of the link.
        .filter(|ip| !matches!(ip, IpAddr::V6(ip) if ip.is_unicast_link_local()))
        .collect();
    addresses.sort();
    addresses.dedup();
    addresses
}

impl From<ViewError> for CommandError {
    fn from(error: ViewError) -> Self {
        match error {
            ViewError::Open(error) => error.into(),
            ViewError::Listen { ref source, .. } if source.kind() == ErrorKind::AddrNotAvailable => {
                Self::BadInput(error.to_string())
            }
            ViewError::Pages { .. } => Self::BadInput(error.to_string()),
            ViewError::Listen { .. } | ViewError::Token(_) => Self::Failed(error.to_string()),
        }
    }
}
