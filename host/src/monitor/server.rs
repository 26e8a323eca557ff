//! The web server of the page: fixed files and one WebSocket for each viewer.
//!
//! Every viewer reads the same frames at its own pace. One that is too slow skips frames and gets a new snapshot; one that takes
//! nothing, or answers no ping, is disconnected. Nothing here can delay the source.

use std::net::SocketAddr;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::Router;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message as Packet, WebSocket, WebSocketUpgrade, close_code};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY, SEC_WEBSOCKET_PROTOCOL,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{broadcast, mpsc, oneshot};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::access::check_origin;
use super::action::Action;
use super::control::{Control, RefusedMessage};
use super::feed::{Feed, Update};
use super::message::{ActionAnswer, Message, SharedFrame, json};
use super::page;
use super::places::{MAX_VIEWERS, ViewerPlace, ViewerPlaces};

/// Longest message of a viewer, bytes.
const LONGEST_MESSAGE: usize = 4096;

/// Time in which a viewer must take a message.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time from ping to ping, and time without an answer after which a viewer has vanished.
const PING_EVERY: Duration = Duration::from_secs(10);
const SILENT_AFTER: Duration = Duration::from_secs(29);

/// The protocol of the WebSocket. A viewer with the token offers [`TOKEN`] and the token beside it.
const PROTOCOL: &str = "damprig";
const TOKEN: &str = "token.";

/// Messages that are malformed, or from a viewer who may not act, after which it is disconnected.
const MAX_MISTAKES: u32 = 10;

/// Actions of a viewer that wait for their answers.
const MAX_ACTIONS: usize = 4;

/// What every connection needs.
#[derive(Debug)]
pub(super) struct ServerState {
    pub(super) address: SocketAddr,
    pub(super) feed: Feed,
    pub(super) control: Control,
    pub(super) places: Arc<ViewerPlaces>,
}

/// The routes of the server.
pub(super) fn routes(shared: Arc<ServerState>) -> Router {
    let files = page::FILES.iter().fold(Router::new(), |router, file| {
        let answer = move |headers: HeaderMap, State(shared): State<Arc<ServerState>>| async move {
            let answer = check(&headers, &shared).map(|()| file.response());
            shared.places.ask_for_file();
            answer.unwrap_or_else(|refusal| refusal)
        };
        router.route(file.path, get(answer))
    });
    files.route("/live", get(live)).with_state(shared)
}

impl page::PageFile {
    fn response(&self) -> Response {
        // Only the server's own files and connection: text that gets into the page cannot load or send anything.
        const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
             img-src 'self' data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'";
        let headers = [
            (CONTENT_TYPE, self.kind),
            (CONTENT_SECURITY_POLICY, POLICY),
            (X_CONTENT_TYPE_OPTIONS, "nosniff"),
            (REFERRER_POLICY, "no-referrer"),
            (CACHE_CONTROL, "no-cache"),
        ];
        (headers, self.text).into_response()
    }
}

fn check(headers: &HeaderMap, shared: &ServerState) -> Result<(), Response> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    check_origin(text(ORIGIN), text(HOST), shared.address.ip())
        .map_err(|why| (StatusCode::FORBIDDEN, format!("{why}\n")).into_response())
}

async fn live(upgrade: WebSocketUpgrade, headers: HeaderMap, State(shared): State<Arc<ServerState>>) -> Response {
    if let Err(refusal) = check(&headers, &shared) {
        return refusal;
    }
    // A browser tells the token here too, so that it gets a place whoever else watches.
    let offered = headers.get_all(SEC_WEBSOCKET_PROTOCOL).iter().filter_map(|value| value.to_str().ok());
    let mut offered = offered.flat_map(|list| list.split(',')).filter_map(|one| one.trim().strip_prefix(TOKEN));
    let has_token = offered.any(|token| shared.control.is_token(token));
    let Some(place) = shared.places.take(has_token) else {
        let text = format!("{MAX_VIEWERS} viewers are connected already; close one of them\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    let upgrade = upgrade.protocols([PROTOCOL]).max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE);
    upgrade.on_upgrade(|socket| async move {
        // A viewer that is gone has no use for an error.
        let _ = Viewer { socket, shared, place, mistakes: 0 }.serve().await;
    })
}

/// The viewer has left, or takes nothing.
struct Gone;

struct Viewer {
    socket: WebSocket,
    shared: Arc<ServerState>,
    place: ViewerPlace,
    mistakes: u32,
}

impl Viewer {
    async fn serve(mut self) -> Result<(), Gone> {
        let mut frames = self.join().await?;
        // Frames go on while an action waits for its answer.
        let (answers, mut answered) = mpsc::channel(MAX_ACTIONS);
        let mut pings = interval(PING_EVERY);
        pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
        let mut heard = Instant::now();
        loop {
            tokio::select! {
                frame = frames.recv() => match frame {
                    Ok(frame) => self.send(Packet::Text(frame.json())).await?,
                    // Too slow, or something else is watched from now on.
                    Err(_) => frames = self.join().await?,
                },
                packet = self.socket.recv() => {
                    heard = Instant::now();
                    match packet {
                        Some(Ok(Packet::Text(text))) => self.act(&text, &answers).await?,
                        Some(Ok(Packet::Binary(_))) => self.act("", &answers).await?,
                        Some(Ok(Packet::Ping(_) | Packet::Pong(_))) => {}
                        // Closed, broken, or a message that is too long.
                        Some(Ok(Packet::Close(_)) | Err(_)) | None => return Err(Gone),
                    }
                }
                Some(answer) = answered.recv() => self.answer(&answer).await?,
                _ = pings.tick() => {
                    if heard.elapsed() > SILENT_AFTER {
                        return Err(Gone);
                    }
                    self.send(Packet::Ping(Default::default())).await?;
                }
                () = self.place.is_needed() => {
                    return self.close(close_code::POLICY, "newer viewers with the token have taken its place").await;
                }
            }
        }
    }

    /// Gets the present state from the monitor, and the frames from there on.
    async fn join(&mut self) -> Result<broadcast::Receiver<Arc<SharedFrame>>, Gone> {
        let (viewer, joined) = oneshot::channel();
        self.shared.feed.send(Update::Join(viewer));
        let Ok((snapshot, frames)) = joined.await else {
            return self.close(close_code::AWAY, "the program has ended").await;
        };
        self.send(Packet::Text(json(&Message::Snapshot(&snapshot)))).await?;
        Ok(frames)
    }

    async fn act(&mut self, text: &str, answers: &mpsc::Sender<ActionAnswer>) -> Result<(), Gone> {
        let request = match self.shared.control.read(text) {
            Ok(request) => request,
            Err(RefusedMessage(answer)) => return self.refuse(&answer).await,
        };
        // A stop waits for nothing.
        if request.action == Action::Stop {
            let answer = self.shared.control.stop(request.id);
            return self.answer(&answer).await;
        }
        let Ok(place) = answers.clone().try_reserve_owned() else {
            let text = "earlier actions are still waiting; try again in a moment".into();
            return self.answer(&ActionAnswer { id: request.id, ok: false, text }).await;
        };
        let shared = Arc::clone(&self.shared);
        tokio::spawn(async move { place.send(shared.control.act(request).await) });
        Ok(())
    }

    async fn answer(&mut self, answer: &ActionAnswer) -> Result<(), Gone> {
        self.send(Packet::Text(json(&Message::Answer(answer)))).await
    }

    /// Answers a message that is malformed, or from a viewer who may not act.
    async fn refuse(&mut self, answer: &ActionAnswer) -> Result<(), Gone> {
        self.answer(answer).await?;
        self.mistakes += 1;
        if self.mistakes >= MAX_MISTAKES {
            return self.close(close_code::POLICY, "too many refused messages").await;
        }
        Ok(())
    }

    async fn close<T>(&mut self, code: u16, reason: &'static str) -> Result<T, Gone> {
        let _ = self.send(Packet::Close(Some(CloseFrame { code, reason: reason.into() }))).await;
        Err(Gone)
    }

    async fn send(&mut self, packet: Packet) -> Result<(), Gone> {
        match timeout(PATIENCE, self.socket.send(packet)).await {
            Ok(Ok(())) => Ok(()),
            Ok(Err(_)) | Err(_) => Err(Gone),
        }
    }
}
