//! `design`: serves the page on which a scene is made.

use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr};
use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use bench_dragon::design::session::{self, DesignFile, Session, greeting};
use bench_dragon::outputs::design::{Answer, Answers, Busy, DesignSession, SaveError, Studio, serve};
use bench_dragon::outputs::view::Ready;
use bench_dragon::show::scene::{SceneError, SceneText};

use super::view::{ReadyLine, own_addresses};
use super::{CommandError, Common, NewFile, Output, stop_on_signals};

/// Arguments of `design`.
#[derive(Debug, clap::Args)]
pub struct DesignArguments {
    /// The port of the page; 0 takes any free one
    #[arg(long, default_value_t = 8090)]
    port: u16,
    /// The address to listen on; beyond loopback the page needs the token that is printed
    #[arg(long, value_name = "ADDR", default_value_t = IpAddr::V4(Ipv4Addr::LOCALHOST))]
    listen: IpAddr,
    /// Let the page write the scene's file; a file that has changed since the page read it stays as it is
    #[arg(long)]
    save: bool,
}

/// Serves the page until a signal comes.
pub fn design(common: &Common, arguments: &DesignArguments) -> Result<(), CommandError> {
    let stop = stop_on_signals()?;
    let file = match &common.scene {
        Some(file) => {
            SceneText::load(file)?;
            Some(Arc::new(SavedFile { path: file.clone(), writing: Mutex::new(()) }))
        }
        None if arguments.save => {
            return Err(CommandError::BadInput(
                "--save needs a scene file to write, expected design FILE --save".into(),
            ));
        }
        None => None,
    };
    let desk = Desk { file, save: arguments.save };
    serve(Arc::new(desk), SocketAddr::new(arguments.listen, arguments.port), &stop, |ready| announce(common, ready))
}

/// The scene's file.
struct SavedFile {
    path: PathBuf,
    /// Held from the comparison of the file to its end, since several pages may save.
    writing: Mutex<()>,
}

impl SavedFile {
    /// Returns the text with the line ends that a text has in a browser.
    fn read(&self) -> Result<String, SceneError> {
        Ok(SceneText::load(&self.path)?.text.replace("\r\n", "\n"))
    }

    /// Writes a text, unless the file is another one than `base`.
    fn save(&self, base: &str, text: &str) -> Result<(), SaveError> {
        let _writing = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        let shown = self.path.display();
        let file = SceneText::load(&self.path).map_err(|error| SaveError::Failed(error.to_string()))?.text;
        let known = file.replace("\r\n", "\n");
        // The answer of an earlier save may have been lost.
        if known == text {
            return Ok(());
        }
        if known != base {
            let sentence = format!(
                "{shown} has changed since this page read it, so nothing was written: load the page again to see the \
                 file (undo brings your text back), or download the scene"
            );
            return Err(SaveError::Changed(sentence));
        }
        let text = if file.contains("\r\n") { text.replace('\n', "\r\n") } else { text.to_owned() };
        let written = NewFile::create(&self.path).and_then(|mut file| {
            io::Write::write_all(&mut file, text.as_bytes())?;
            file.finish()
        });
        written.map_err(|error| match error {
            CommandError::BadInput(sentence) | CommandError::Failed(sentence) => SaveError::Failed(sentence),
            CommandError::ClosedPipe => SaveError::Failed(format!("{shown} is a closed pipe")),
        })
    }
}

/// The file and the rights that the pages of this command share.
struct Desk {
    file: Option<Arc<SavedFile>>,
    save: bool,
}

impl Desk {
    fn design_file(&self) -> Option<DesignFile> {
        let file = Arc::clone(self.file.as_ref()?);
        let shown = file.path.display().to_string();
        Some(DesignFile { shown, read: Arc::new(move || file.read()), save: self.save })
    }
}

impl Studio for Desk {
    fn greeting(&self, needs_token: bool) -> String {
        greeting(self.design_file().as_ref(), needs_token)
    }

    fn open(&self, answers: Answers) -> io::Result<Box<dyn DesignSession>> {
        let answers = move |answer| {
            answers(match answer {
                session::Answer::Json(json) => Answer::Json(json),
                session::Answer::Stage(stage, name) => Answer::Stage(stage, name),
                session::Answer::Frame(header, poses) => Answer::Frame(header, poses),
            });
        };
        Ok(Box::new(Open(Session::start(self.design_file(), Arc::new(answers))?)))
    }

    fn save(&self, base: &str, text: &str) -> Result<(), SaveError> {
        match &self.file {
            Some(file) if self.save => file.save(base, text),
            _ => Err(SaveError::Failed("this server was started without --save: download the scene".to_owned())),
        }
    }
}

/// A page's session.
struct Open(Session);

impl DesignSession for Open {
    fn request(&self, json: String) -> Result<(), Busy> {
        self.0.request(json).ok_or(Busy)
    }
}

fn announce(common: &Common, ready: &Ready) -> Result<(), CommandError> {
    let Ready { address, ref token } = *ready;
    let is_of_all = address.ip().is_unspecified();
    let fragment = token.as_ref().map_or(String::new(), |token| format!("#token={}", token.as_str()));
    let others = if is_of_all { own_addresses(address.ip()) } else { Vec::new() };
    let url = |host: &str| format!("http://{host}/");
    let others: Vec<String> = others.iter().map(|ip| url(&SocketAddr::new(*ip, address.port()).to_string())).collect();
    let mut output = Output::standard();
    if common.json {
        let token = token.as_ref().map(|token| token.as_str().to_owned());
        output.json(&ReadyLine { r#type: "ready", url: url(&address.to_string()), others, token })?;
        return output.finish();
    }
    let here = if is_of_all { format!("localhost:{}", address.port()) } else { address.to_string() };
    output.line(&format!("The design page is at {}{fragment}. Ctrl-C ends.", url(&here)))?;
    others.iter().try_for_each(|url| output.line(&format!("  from elsewhere: {url}{fragment}")))?;
    if token.is_some() {
        output.line("Only who has this address with its token may design.")?;
    }
    output.finish()
}
