//! Places of the viewers: some for everybody, and some that only those with the token can take.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use tokio::sync::Notify;

/// Most viewers without the token.
pub(super) const MAX_VIEWERS: usize = 64;

/// Most viewers with the token. The oldest makes room for one more: it may be a page that nobody looks at.
pub(super) const MAX_WITH_TOKEN: usize = 16;

/// The places.
#[derive(Debug, Default)]
pub(super) struct ViewerPlaces {
    all: Mutex<Vec<Arc<TakenPlace>>>,
    /// Files of the page that were asked for: a browser asks for them before it takes a place.
    files_asked: AtomicU64,
}

/// A place that is taken.
#[derive(Debug)]
struct TakenPlace {
    has_token: bool,
    /// It is told to leave.
    leaves: Notify,
}

/// A viewer's place, until it is dropped.
#[derive(Debug)]
pub(super) struct ViewerPlace {
    own: Arc<TakenPlace>,
    all: Arc<ViewerPlaces>,
}

impl ViewerPlaces {
    fn taken(&self) -> MutexGuard<'_, Vec<Arc<TakenPlace>>> {
        self.all.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Notes that a file of the page was asked for.
    pub(super) fn ask_for_file(&self) {
        self.files_asked.fetch_add(1, Ordering::Relaxed);
    }

    /// How many files of the page were asked for so far.
    pub(super) fn files_asked(&self) -> u64 {
        self.files_asked.load(Ordering::Relaxed)
    }

    /// Number of viewers.
    pub(super) fn viewers(&self) -> usize {
        self.taken().len()
    }

    /// Takes a place; none when all of those without the token are taken.
    pub(super) fn take(self: &Arc<Self>, has_token: bool) -> Option<ViewerPlace> {
        let mut taken = self.taken();
        let count = taken.iter().filter(|place| place.has_token == has_token).count();
        if !has_token && count >= MAX_VIEWERS {
            return None;
        }
        if has_token
            && count >= MAX_WITH_TOKEN
            && let Some(oldest) = taken.iter().position(|place| place.has_token)
        {
            taken.remove(oldest).leaves.notify_one();
        }
        let own = Arc::new(TakenPlace { has_token, leaves: Notify::new() });
        taken.push(Arc::clone(&own));
        Some(ViewerPlace { own, all: Arc::clone(self) })
    }
}

impl ViewerPlace {
    /// Returns when another viewer needs the place.
    pub(super) async fn is_needed(&self) {
        self.own.leaves.notified().await;
    }
}

impl Drop for ViewerPlace {
    fn drop(&mut self) {
        self.all.taken().retain(|place| !Arc::ptr_eq(place, &self.own));
    }
}
