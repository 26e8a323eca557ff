//! Accepts the connections of browsers and other programs: few at a time and for a short time, so that nobody can use up the
//! files that the program may open.
//!
//! A connection carries one request and its answer. One that has sent no whole request makes room for the next when there are
//! many. A viewer's WebSocket leaves this list and takes a place among the viewers (`places`).

use std::collections::VecDeque;
use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use axum::Router;
use axum::extract::Request;
use axum::http::header::CONNECTION;
use axum::http::{HeaderValue, StatusCode};
use axum::response::Response;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::TokioIo;
use tokio::net::{TcpListener, TcpStream};
use tokio::task::AbortHandle;
use tokio::time::{sleep, timeout};
use tower_service::Service;

/// Most connections without a viewer.
const MAX: usize = 64;

/// Time for a request and its answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Pause after a connection that could not be accepted.
const PAUSE: Duration = Duration::from_millis(20);

/// A connection that is served.
struct Open {
    task: AbortHandle,
    has_asked: Arc<AtomicBool>,
}

/// Accepts connections until it is dropped.
pub(super) async fn accept(listener: TcpListener, routes: Router) {
    let mut all: VecDeque<Open> = VecDeque::new();
    loop {
        let Ok((stream, _)) = listener.accept().await else {
            sleep(PAUSE).await;
            continue;
        };
        all.retain(|open| !open.task.is_finished());
        if all.len() >= MAX {
            let silent = all.iter().position(|open| !open.has_asked.load(Ordering::Relaxed));
            all.remove(silent.unwrap_or(0)).into_iter().for_each(|open| open.task.abort());
            // Lets the runtime close it.
            tokio::task::yield_now().await;
        }
        let has_asked = Arc::new(AtomicBool::new(false));
        let task = tokio::spawn(serve(stream, routes.clone(), Arc::clone(&has_asked))).abort_handle();
        all.push_back(Open { task, has_asked });
    }
}

/// Answers the request of a connection. Returns when it is answered, or has become a viewer's.
async fn serve(stream: TcpStream, routes: Router, has_asked: Arc<AtomicBool>) {
    let answer = service_fn(move |request: Request<Incoming>| {
        has_asked.store(true, Ordering::Relaxed);
        let mut routes = routes.clone();
        async move {
            let mut answer: Response = routes.call(request).await.unwrap_or_else(|never| match never {});
            if answer.status() != StatusCode::SWITCHING_PROTOCOLS {
                answer.headers_mut().insert(CONNECTION, HeaderValue::from_static("close"));
            }
            Ok::<Response, Infallible>(answer)
        }
    });
    let connection = http1::Builder::new().serve_connection(TokioIo::new(stream), answer);
    // One that breaks or is too slow has no use for an error.
    let _ = timeout(PATIENCE, connection.with_upgrades()).await;
}
