//! The web server of the page: fixed files and one WebSocket for each viewer.
//!
//! Every viewer reads the same frames at its own pace. One that is too slow skips frames and gets a new snapshot; one that takes
//! nothing for a while is disconnected. Nothing here can delay the source.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::State;
use axum::extract::ws::{CloseFrame, Message as Packet, WebSocket, WebSocketUpgrade, close_code};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HOST, ORIGIN, REFERRER_POLICY, X_CONTENT_TYPE_OPTIONS,
};
use axum::http::{HeaderMap, StatusCode};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use tokio::sync::{broadcast, mpsc, oneshot};
use tokio::time::{MissedTickBehavior, interval, timeout};

use super::access::check_origin;
use super::control::Control;
use super::feed::{Feed, Update};
use super::message::{Answer, Message, SharedFrame, json};
use super::page;

/// Most viewers at a time.
const MOST_VIEWERS: usize = 64;

/// Longest message of a viewer, bytes.
const LONGEST_MESSAGE: usize = 4096;

/// Time in which a viewer must take a message.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time from ping to ping: a viewer that has vanished is noticed.
const PING_EVERY: Duration = Duration::from_secs(15);

/// Refused messages after which a viewer is disconnected.
const MOST_MISTAKES: u32 = 10;

/// Actions of a viewer that wait for their answers.
const MOST_ACTIONS: usize = 4;

/// What every connection needs.
pub(super) struct Shared {
    pub(super) address: SocketAddr,
    pub(super) feed: Feed,
    pub(super) control: Control,
    pub(super) viewers: AtomicUsize,
}

/// The routes of the server.
pub(super) fn routes(shared: Arc<Shared>) -> Router {
    let files = page::FILES.iter().fold(Router::new(), |router, file| {
        let answer = move |headers: HeaderMap, State(shared): State<Arc<Shared>>| async move {
            check(&headers, &shared).map_or_else(|refusal| refusal, |()| file.response())
        };
        router.route(file.path, get(answer))
    });
    files.route("/live", get(live)).with_state(shared)
}

impl page::File {
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

fn check(headers: &HeaderMap, shared: &Shared) -> Result<(), Response> {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    check_origin(text(ORIGIN), text(HOST), shared.address.ip())
        .map_err(|why| (StatusCode::FORBIDDEN, format!("{why}\n")).into_response())
}

async fn live(upgrade: WebSocketUpgrade, headers: HeaderMap, State(shared): State<Arc<Shared>>) -> Response {
    if let Err(refusal) = check(&headers, &shared) {
        return refusal;
    }
    if shared.viewers.fetch_add(1, Ordering::Relaxed) >= MOST_VIEWERS {
        shared.viewers.fetch_sub(1, Ordering::Relaxed);
        let text = format!("{MOST_VIEWERS} viewers are connected already; close one of them\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    }
    let leaves = Leaves(Arc::clone(&shared));
    upgrade.max_message_size(LONGEST_MESSAGE).max_frame_size(LONGEST_MESSAGE).on_upgrade(|socket| async move {
        // A viewer that is gone has no use for an error.
        let _ = Viewer { socket, shared: Arc::clone(&leaves.0), mistakes: 0 }.serve().await;
        drop(leaves);
    })
}

/// Counts a viewer until it is dropped.
struct Leaves(Arc<Shared>);

impl Drop for Leaves {
    fn drop(&mut self) {
        self.0.viewers.fetch_sub(1, Ordering::Relaxed);
    }
}

/// The viewer has left, or takes nothing.
struct Gone;

struct Viewer {
    socket: WebSocket,
    shared: Arc<Shared>,
    mistakes: u32,
}

impl Viewer {
    async fn serve(mut self) -> Result<(), Gone> {
        let mut frames = self.join().await?;
        // Frames go on while an action waits for its answer.
        let (answers, mut answered) = mpsc::channel(MOST_ACTIONS);
        let mut pings = interval(PING_EVERY);
        pings.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                frame = frames.recv() => match frame {
                    Ok(frame) => self.send(Packet::Text(frame.json())).await?,
                    // Too slow, or something else is watched from now on.
                    Err(_) => frames = self.join().await?,
                },
                packet = self.socket.recv() => match packet {
                    Some(Ok(Packet::Text(text))) => self.act(text.to_string(), &answers).await?,
                    Some(Ok(Packet::Binary(_))) => self.act(String::new(), &answers).await?,
                    Some(Ok(Packet::Ping(_) | Packet::Pong(_))) => {}
                    // Closed, broken, or a message that is too long.
                    Some(Ok(Packet::Close(_)) | Err(_)) | None => return Err(Gone),
                },
                Some(answer) = answered.recv() => self.answer(&answer).await?,
                _ = pings.tick() => self.send(Packet::Ping(Default::default())).await?,
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

    async fn act(&mut self, text: String, answers: &mpsc::Sender<Answer>) -> Result<(), Gone> {
        let Ok(place) = answers.clone().try_reserve_owned() else {
            let text = "earlier actions are still waiting; try again in a moment".into();
            return self.answer(&Answer { id: 0, ok: false, text }).await;
        };
        let shared = Arc::clone(&self.shared);
        tokio::spawn(async move { place.send(shared.control.answer(&text).await) });
        Ok(())
    }

    async fn answer(&mut self, answer: &Answer) -> Result<(), Gone> {
        self.mistakes += u32::from(!answer.ok);
        self.send(Packet::Text(json(&Message::Answer(answer)))).await?;
        if self.mistakes >= MOST_MISTAKES {
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
