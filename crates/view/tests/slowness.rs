//! Clients that are slow, many, or gone hold up nobody else.

use crate::client::{SHORT, Served, read_all};
use serde_json::json;
use std::io::{Read, Write};
use std::time::{Duration, Instant};

/// Long enough on a busy machine.
const SOON: Duration = Duration::from_secs(10);

#[test]
fn a_slow_head_and_a_slow_body_end_in_time_while_others_are_answered() {
    let served = Served::new();
    let began = Instant::now();
    let mut slow_head = served.connect();
    slow_head.write_all(b"GET /token/ HTTP/1.1\r\nHo").unwrap();
    let mut slow_body = served.connect();
    let head = format!(
        "POST /token/edit HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\n\
         Connection: close\r\nContent-Length: 30\r\n\r\n{{\"ed",
        served.host()
    );
    slow_body.write_all(head.as_bytes()).unwrap();
    assert_eq!(served.get("").status, 200);
    let answered = read_all(&mut slow_body);
    assert_eq!(answered.status, 408, "{answered:?}");
    assert!(answered.error().contains("too long"));
    let answered = read_all(&mut slow_head);
    assert!(matches!(answered.status, 0 | 408), "{answered:?}");
    assert!(began.elapsed() > SHORT && began.elapsed() < SOON);
    assert_eq!(served.session.revision(), 1);
}

#[test]
fn a_client_that_does_not_read_is_left() {
    let served = Served::new();
    let request = format!(
        "GET /token/main.js HTTP/1.1\r\nHost: {}\r\n\r\n",
        served.host()
    );
    let mut deaf = served.connect();
    deaf.set_write_timeout(Some(Duration::from_secs(1)))
        .unwrap();
    // Answers fill what the system keeps for the client, and then the server waits.
    let began = Instant::now();
    let left = loop {
        if deaf.write_all(request.repeat(200).as_bytes()).is_err() {
            break true;
        }
        if began.elapsed() > 2 * SOON {
            break false;
        }
    };
    assert!(left, "the server takes requests for ever");
    assert_eq!(served.get("").status, 200);
    // What was answered before can be read, and then the connection ends.
    let mut rest = Vec::new();
    let _ = deaf.read_to_end(&mut rest);
    assert!(began.elapsed() < 3 * SOON);
}

#[test]
fn more_connections_than_seats_are_served_in_turn() {
    let served = Served::new();
    let began = Instant::now();
    let idle: Vec<_> = (0..80).map(|_| served.connect()).collect();
    assert_eq!(served.get("").status, 200);
    assert!(began.elapsed() < SOON, "{:?}", began.elapsed());
    drop(idle);
    assert_eq!(served.get("").status, 200);
}

/// Heads that never end have a minute, and the request that follows does not wait for it. What
/// has asked for the page before keeps its connection.
#[test]
fn half_open_connections_hold_up_no_request() {
    let served = Served::waiting("scene.toml", false, 6 * SOON);
    let request = format!("GET /token/ HTTP/1.1\r\nHost: {}\r\n", served.host());
    let mut tab = served.connect();
    tab.write_all(format!("{request}\r\n").as_bytes()).unwrap();
    let mut first = [0; 15];
    tab.read_exact(&mut first).unwrap();
    let half_open: Vec<_> = (0..200)
        .map(|_| {
            let mut stream = served.connect();
            stream.write_all(b"GET /nobody/ HTTP/1.1\r\nHo").unwrap();
            stream
        })
        .collect();
    let began = Instant::now();
    assert_eq!(served.get("").status, 200);
    assert!(began.elapsed() < SOON, "{:?}", began.elapsed());
    tab.write_all(format!("{request}Connection: close\r\n\r\n").as_bytes())
        .unwrap();
    let mut rest = Vec::new();
    tab.read_to_end(&mut rest).unwrap();
    let rest = String::from_utf8_lossy(&rest);
    assert!(rest.contains("HTTP/1.1 200 OK"), "{rest}");
    drop(half_open);
}

#[test]
fn connections_that_are_gone_leave_nothing_behind() {
    let served = Served::new();
    let host = served.host();
    for text in [
        "GET /token/ma".to_owned(),
        format!("GET /token/main.js HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!("GET /token/news?after=1&known=1 HTTP/1.1\r\nHost: {host}\r\n\r\n"),
        format!(
            "POST /token/edit HTTP/1.1\r\nHost: {host}\r\nContent-Type: application/json\r\n\
             Content-Length: 200\r\n\r\n{{\"edits\":[{{\"op\":\"add-light\",\"kind\":\"spot\"}}]"
        ),
    ] {
        for _ in 0..20 {
            served.connect().write_all(text.as_bytes()).unwrap();
        }
    }
    assert_eq!(served.get("").status, 200);
    assert_eq!(
        served.session.revision(),
        1,
        "a change that broke off is none"
    );
}

#[test]
fn every_tab_hears_of_a_change_at_once() {
    let served = Served::new();
    let serial = served.get("news?after=0&known=0").json()["serial"]
        .as_u64()
        .unwrap();
    std::thread::scope(|scope| {
        let ask = || served.get(&format!("news?after={serial}&known=1"));
        let tabs: Vec<_> = (0..4).map(|_| scope.spawn(ask)).collect();
        std::thread::sleep(SHORT / 4);
        let light = json!([{ "op": "add-light", "kind": "rectangle" }]);
        assert_eq!(served.edit(light), 2);
        for tab in tabs {
            let news = tab.join().unwrap().json();
            assert_eq!(news["document"]["revision"], 2, "{news}");
            assert_eq!(news["document"]["scene"]["light"][2]["kind"], "rectangle");
        }
    });
    // A tab that knows all waits, and learns that there is nothing new.
    let serial = served.session.serial();
    let began = Instant::now();
    let news = served.get(&format!("news?after={serial}&known=2")).json();
    assert!(news["document"].is_null() && began.elapsed() >= SHORT);
    // The numbers of another session do not keep a tab waiting.
    let began = Instant::now();
    served.get("news?after=999999&known=7");
    assert!(began.elapsed() < SHORT, "{:?}", began.elapsed());
}
