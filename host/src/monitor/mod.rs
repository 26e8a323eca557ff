//! The live monitor: a page on this machine, or in the lab's network, that shows a run, an idle rig or a run folder as it moves.
//!
//! A source (`run`, `rig`, `folder`) tells what happens through a [`Feed`], which never waits. The monitor's own thread (`hub`)
//! keeps the recent past and makes frames of what is new; the web server's thread (`server`) hands the same frames to every
//! viewer. So a slow, sleeping or dead viewer can delay neither the recorder nor the link. The terminal view ([`terminal`]) is a
//! viewer too.

mod access;
pub mod action;
mod connections;
mod control;
pub mod feed;
pub mod folder;
mod history;
mod hub;
mod live;
pub mod message;
pub mod numbers;
mod page;
mod places;
pub mod rig;
pub mod run;
mod running_ratio;
mod screen;
mod section;
mod server;
pub mod spectrum;
pub mod terminal;
mod unsent;
mod words;

use std::net::{IpAddr, SocketAddr, TcpListener};
use std::sync::Arc;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::oneshot;

pub use access::Token;
pub use control::{Actions, Asked, Handles, Player};
pub use feed::Feed;
pub use words::spring as spring_event;

use crate::failure::Failure;
use control::Control;
use feed::Update;
use live::Live;
use places::ViewerPlaces;
use server::ServerState;

/// The port of the page when none is given and it is free.
pub const PORT: u16 = 8421;

/// Longest time in which viewers get the last frame when the source has ended.
const FAREWELL: Duration = Duration::from_secs(3);

/// Time between two looks whether all of them have left.
const TURN: Duration = Duration::from_millis(10);

/// What viewers may do, and what they are told about it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Permissions {
    /// Actions are possible with the token.
    pub can_control: bool,
    /// Faults can be injected with the token: the rig is simulated and runs in real time.
    pub can_inject: bool,
    /// Where a run can be stopped, in words.
    pub where_to_stop: String,
}

/// Where the page is served, and who may control.
#[derive(Clone, Debug)]
pub struct Serving {
    /// The address; none for [`PORT`] on the loopback address, or another port if that one is in use.
    pub listen: Option<SocketAddr>,
    /// The token of those who may control; none for a page that only shows.
    pub token: Option<Token>,
}

/// A running monitor.
#[derive(Debug)]
pub struct Monitor {
    feed: Feed,
    actions: Option<Actions>,
    player: Player,
    hub: JoinHandle<()>,
    page: Option<MonitorPage>,
}

/// The page of a monitor.
#[derive(Debug)]
struct MonitorPage {
    address: SocketAddr,
    token: Option<Token>,
    places: Arc<ViewerPlaces>,
    /// What the web server needs, until it is started.
    waits: Option<(TcpListener, ServerState)>,
    server: Option<Server>,
}

/// The web server of a page.
#[derive(Debug)]
struct Server {
    /// It ends soon after this is dropped.
    ended: oneshot::Sender<()>,
    thread: JoinHandle<()>,
}

fn failed(error: std::io::Error) -> Failure {
    Failure::Failed(format!("cannot start the monitor: {error}"))
}

impl Monitor {
    /// Starts the monitor, and its web server if a page is wanted.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn start(serving: Option<Serving>, permissions: Permissions, handles: Handles) -> Result<Self, Failure> {
        let mut monitor = Self::prepare(serving, permissions, handles)?;
        monitor.serve()?;
        Ok(monitor)
    }

    /// Starts the monitor and takes the address of its page, which is served from [`Monitor::serve`] on.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn prepare(serving: Option<Serving>, permissions: Permissions, handles: Handles) -> Result<Self, Failure> {
        let listener = serving.as_ref().map(|serving| listen(serving.listen)).transpose()?;
        let (feed, updates) = feed::feed();
        let token = serving.and_then(|serving| serving.token);
        let (control, actions) = Control::new(token.clone(), handles, feed.clone(), permissions.where_to_stop.clone());
        let player = control.player();
        let live = Live::new(permissions);
        let hub = std::thread::Builder::new().name("monitor".into());
        let hub = hub.spawn(move || hub::run(live, &updates)).map_err(failed)?;
        let page = listener.map(|listener| MonitorPage::new(listener, token, feed.clone(), control)).transpose()?;
        Ok(Self { feed, actions: Some(actions), player, hub, page })
    }

    /// Serves the page, if there is one, from now on.
    ///
    /// # Errors
    /// The system has no room for another thread.
    pub fn serve(&mut self) -> Result<(), Failure> {
        self.page.as_mut().map_or(Ok(()), MonitorPage::serve)
    }

    /// Number of viewers of the page.
    #[must_use]
    pub fn viewers(&self) -> usize {
        self.page.as_ref().map_or(0, |page| page.places.viewers())
    }

    /// How many files of the page were asked for so far: a browser that loads the page is no viewer yet.
    #[must_use]
    pub fn files_asked(&self) -> u64 {
        self.page.as_ref().map_or(0, |page| page.places.files_asked())
    }

    /// The source's end.
    #[must_use]
    pub fn feed(&self) -> Feed {
        self.feed.clone()
    }

    /// The actions of viewers; once.
    pub fn take_actions(&mut self) -> Option<Actions> {
        self.actions.take()
    }

    /// Plays and pauses a replay.
    #[must_use]
    pub fn player(&self) -> Player {
        self.player.clone()
    }

    /// The address of the page, with the token if there is one.
    #[must_use]
    pub fn url(&self) -> Option<String> {
        let MonitorPage { address, token, .. } = self.page.as_ref()?;
        let mut address = *address;
        if address.ip().is_unspecified() {
            // Served at every address of this machine: this one can be opened here.
            address.set_ip(IpAddr::V4(std::net::Ipv4Addr::LOCALHOST));
        }
        Some(match token {
            Some(token) => format!("http://{address}/#token={}", token.text()),
            None => format!("http://{address}/"),
        })
    }

    /// Whether viewers with the token can act.
    #[must_use]
    pub fn can_control(&self) -> bool {
        self.page.as_ref().is_some_and(|page| page.token.is_some())
    }

    /// Whether other machines can open the page.
    #[must_use]
    pub fn is_public(&self) -> bool {
        self.page.as_ref().is_some_and(|page| !page.address.ip().is_loopback())
    }

    /// Ends the monitor. Viewers get what was told last.
    pub fn end(self) {
        self.feed.send(Update::End);
        let _ = self.hub.join();
        if let Some(Server { ended, thread }) = self.page.and_then(|page| page.server) {
            drop(ended);
            let _ = thread.join();
        }
    }
}

impl MonitorPage {
    fn new(listener: TcpListener, token: Option<Token>, feed: Feed, control: Control) -> Result<Self, Failure> {
        let address = listener.local_addr().map_err(failed)?;
        listener.set_nonblocking(true).map_err(failed)?;
        let places = Arc::new(ViewerPlaces::default());
        let shared = ServerState { address, feed, control, places: Arc::clone(&places) };
        Ok(Self { address, token, places, waits: Some((listener, shared)), server: None })
    }

    fn serve(&mut self) -> Result<(), Failure> {
        let Some((listener, shared)) = self.waits.take() else { return Ok(()) };
        let places = Arc::clone(&self.places);
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(failed)?;
        let (ended, ends) = oneshot::channel();
        let thread = std::thread::Builder::new().name("monitor page".into());
        let thread = thread.spawn(move || {
            runtime.block_on(async {
                let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
                tokio::select! {
                    () = connections::accept(listener, server::routes(Arc::new(shared))) => {}
                    _ = ends => {
                        let until = Instant::now() + FAREWELL;
                        while places.viewers() > 0 && Instant::now() < until {
                            tokio::time::sleep(TURN).await;
                        }
                    }
                }
            });
        });
        self.server = Some(Server { ended, thread: thread.map_err(failed)? });
        Ok(())
    }
}

/// Binds the address.
fn listen(wanted: Option<SocketAddr>) -> Result<TcpListener, Failure> {
    let loopback = |port| SocketAddr::from(([127, 0, 0, 1], port));
    let Some(address) = wanted else {
        let usual = TcpListener::bind(loopback(PORT)).or_else(|_| TcpListener::bind(loopback(0)));
        return usual.map_err(|e| Failure::Failed(format!("cannot serve the monitor's page on this machine: {e}")));
    };
    TcpListener::bind(address).map_err(|error| {
        let hint = match error.kind() {
            std::io::ErrorKind::AddrInUse => {
                "is another monitor running there? Give another port, or port 0 for any that is free"
            }
            std::io::ErrorKind::AddrNotAvailable => {
                "this machine does not have that address; 127.0.0.1 is for this machine only, 0.0.0.0 for every network"
            }
            std::io::ErrorKind::PermissionDenied => "ports below 1024 are reserved; give a higher one",
            _ => "give another address",
        };
        Failure::Failed(format!("--listen {address}: {error}; {hint}"))
    })
}
