//! Who may act on a run through the live monitor, and what becomes of an action.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Instant;

use damprig::monitor::action::Action;
use damprig::monitor::{Actions, Asked, Handles, Token};
use serde_json::json;
use tungstenite::Message;
use tungstenite::http::StatusCode;

use crate::monitor::{PATIENCE, Viewer, address, monitor};

/// The next action for the source.
fn next(actions: &Actions) -> Asked {
    let begun = Instant::now();
    loop {
        match actions.next() {
            Some(asked) => return asked,
            None => assert!(begun.elapsed() < PATIENCE, "no action"),
        }
        std::thread::yield_now();
    }
}

#[test]
fn a_stop_goes_before_all_that_waits_and_is_answered_however_often_it_is_asked_for() {
    let token = Token::new().unwrap();
    let mut monitor = monitor(Some(token.clone()), Handles::default());
    let actions = monitor.take_actions().unwrap();
    let mut viewers: Vec<Viewer> = (0..4).map(|_| Viewer::join(&monitor)).collect();
    // Far more than can wait for the source, which takes none of them; the rest is refused.
    for viewer in &mut viewers {
        (10..30).for_each(|id| viewer.send(&json!({"id": id, "do": "hold", "token": token.text()})));
    }
    for id in 0..40 {
        let viewer = &mut viewers[id % 4];
        let stop = json!({"id": 100 + id, "do": "stop", "token": token.text()});
        viewer.send(&stop);
        let answers = viewer.until(|message| message["kind"] == "answer" && message["id"] == 100 + id);
        assert_eq!(answers[answers.len() - 1]["ok"], true);
    }
    // The source gets it once, and first.
    assert_eq!(next(&actions).action, Action::Stop);
    assert_eq!(next(&actions).action, Action::Hold);
    // It is known when an action was asked for before the stop: nothing is left of it after all that waited.
    while actions.next().is_some() {}
    // The actions that waited are answered too.
    viewers[0].send(&json!({"id": 1, "do": "stop", "token": token.text()}));
    let answers = viewers[0].until(|message| message["kind"] == "answer" && message["id"] == 1);
    assert_eq!(answers[answers.len() - 1]["ok"], true);
    assert_eq!(next(&actions).action, Action::Stop);
}

#[test]
fn a_person_who_may_act_is_not_sent_away_for_actions_that_cannot_be_done() {
    let token = Token::new().unwrap();
    let mut monitor = monitor(Some(token.clone()), Handles::default());
    let actions = monitor.take_actions().unwrap();
    std::thread::spawn(move || (0..30).for_each(|_| next(&actions).answer(Err("It cannot be done.".into()))));
    let mut viewer = Viewer::join(&monitor);
    for id in 0..30 {
        assert_eq!(viewer.ask(json!({"id": id, "do": "clear_fault", "token": token.text()}))["ok"], false);
    }
}

#[test]
fn the_oldest_viewer_with_the_token_makes_room_for_a_new_one() {
    let token = Token::new().unwrap();
    let monitor = monitor(Some(token.clone()), Handles::default());
    let own = address(&monitor);
    let mut first = Viewer::with_token(&own, token.text()).unwrap();
    let mut others: Vec<Viewer> = (0..16).map(|_| Viewer::with_token(&own, token.text()).unwrap()).collect();
    first.until_closed();
    assert!(others.iter_mut().all(|viewer| viewer.next().is_some()));
    // A wrong token takes a place of those without.
    let everybody: Vec<Viewer> = (0..64).map(|_| Viewer::with_token(&own, "0123").unwrap()).collect();
    assert_eq!(Viewer::with_token(&own, "0123").err(), Some(StatusCode::SERVICE_UNAVAILABLE));
    assert!(Viewer::with_token(&own, token.text()).is_ok());
    drop(everybody);
}

#[test]
fn a_page_of_another_origin_is_refused() {
    let monitor = monitor(Some(Token::new().unwrap()), Handles::default());
    let own = address(&monitor);
    for origin in ["http://evil.example", "null", "https://127.0.0.1:1"] {
        assert_eq!(Viewer::connect(&own, Some(origin)).err(), Some(StatusCode::FORBIDDEN), "{origin}");
    }
    assert!(Viewer::connect(&own, Some(&format!("http://{own}"))).is_ok());
}

#[test]
fn actions_need_control_and_the_token() {
    let stop = Arc::new(AtomicBool::new(false));
    let handles = || Handles { stop: Some(Arc::clone(&stop)), ..Handles::default() };
    let closed = monitor(None, handles());
    let answer = Viewer::join(&closed).ask(json!({"id": 1, "do": "stop", "token": ""}));
    assert_eq!((&answer["id"], &answer["ok"]), (&json!(1), &json!(false)));
    assert!(answer["text"].as_str().unwrap().contains("view only. Stop: here."), "{answer}");
    let token = Token::new().unwrap();
    let open = monitor(Some(token.clone()), handles());
    let mut viewer = Viewer::join(&open);
    for wrong in ["", "0123456789abcdef0123456789abcdef", &token.text()[..31]] {
        let answer = viewer.ask(json!({"id": 2, "do": "stop", "token": wrong}));
        assert_eq!(answer["ok"], false);
        assert!(answer["text"].as_str().unwrap().contains("token"), "{answer}");
    }
    assert!(!stop.load(Ordering::Relaxed));
    let answer = viewer.ask(json!({"id": 3, "do": "stop", "token": token.text()}));
    assert_eq!((&answer["id"], &answer["ok"]), (&json!(3), &json!(true)));
    assert!(stop.load(Ordering::Relaxed));
}

#[test]
fn an_action_reaches_the_source_and_its_answer_the_viewer() {
    let token = Token::new().unwrap();
    let mut monitor = monitor(Some(token.clone()), Handles::default());
    let actions = monitor.take_actions().unwrap();
    let source = std::thread::spawn(move || {
        let asked = next(&actions);
        let text = format!("{:?}", asked.action);
        asked.answer(Ok(text));
    });
    let answer =
        Viewer::join(&monitor).ask(json!({"id": 9, "do": "set_spring", "force_n": 12.5, "token": token.text()}));
    assert_eq!(answer, json!({"kind": "answer", "id": 9, "ok": true, "text": "SetSpring { force_n: 12.5 }"}));
    source.join().unwrap();
}

#[test]
fn malformed_messages_are_answered_and_many_of_them_or_a_long_one_end_the_connection() {
    let monitor = monitor(Some(Token::new().unwrap()), Handles::default());
    let mut viewer = Viewer::join(&monitor);
    // Nothing is replayed here, and nobody needs a token to ask for it.
    assert_eq!(viewer.ask(json!({"do": "replay", "to_s": 1e300}))["text"], "nothing is replayed here");
    let hostile =
        [json!(3), json!({"do": "explode"}), json!({"do": "set_spring"}), json!([]), json!({"id": -1, "do": "stop"})];
    for message in hostile {
        assert_eq!(viewer.ask(message)["ok"], false);
    }
    for _ in 0..3 {
        viewer.0.send(Message::text("no JSON \u{1b}[2J")).unwrap();
        viewer.until(|message| message["kind"] == "answer");
    }
    viewer.0.send(Message::binary(vec![0xff; 100])).unwrap();
    viewer.until_closed();
    let mut viewer = Viewer::join(&monitor);
    // The monitor may close before all of it is sent.
    let _ = viewer.0.send(Message::text("x".repeat(5000)));
    viewer.until_closed();
    // The others are not disturbed.
    assert_eq!(Viewer::join(&monitor).next().unwrap()["kind"], "snapshot");
}

#[test]
fn wrong_tokens_do_not_fill_the_log() {
    let monitor = monitor(Some(Token::new().unwrap()), Handles::default());
    for _ in 0..3 {
        let mut viewer = Viewer::join(&monitor);
        (0..9).for_each(|_| drop(viewer.ask(json!({"do": "stop", "token": "0123456789abcdef0123456789abcdef"}))));
    }
    let snapshot = Viewer::join(&monitor).next().unwrap();
    assert_eq!(snapshot["log"].as_array().unwrap().len(), 1);
}
