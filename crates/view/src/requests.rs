//! What requests ask for, and the answers.

use crate::assets::asset;
use crate::edit::Edit;
use crate::guard::{Guard, Refusal};
use crate::made_fabric::MAX_DRAFT_BYTES;
use crate::saving::check_name;
use crate::session::Session;
use crate::{describe, opening};
use http_body_util::{BodyExt, Full, Limited};
use hyper::body::{Body, Bytes};
use hyper::header::{self, HeaderName, HeaderValue};
use hyper::{Method, Request, Response, StatusCode};
use serde::Deserialize;
use serde_json::{Value, json};
use std::sync::Arc;
use std::time::Duration;
use tokio::sync::Semaphore;

/// Bytes of a request that is no draft at most.
const MAX_JSON_BYTES: usize = 64 << 10;

/// How long requests may take.
#[derive(Clone, Copy, Debug)]
pub struct Patience {
    /// From the head of a request to the end of its body.
    pub body: Duration,
    /// For news.
    pub news: Duration,
    /// For a picture that is to be saved.
    pub picture: Duration,
}

impl Default for Patience {
    fn default() -> Patience {
        Patience {
            body: Duration::from_secs(20),
            // Browsers open few connections to a host, and every tab has one that waits.
            news: Duration::from_secs(3),
            picture: Duration::from_secs(120),
        }
    }
}

/// What answers requests.
pub struct Answering {
    session: Arc<Session>,
    guard: Guard,
    patience: Patience,
    /// Dropped drafts are woven one at a time.
    weaving: Semaphore,
}

/// What is said to a request that cannot be answered.
struct Refused(StatusCode, String);

impl Refused {
    fn new(status: StatusCode, why: impl Into<String>) -> Refused {
        Refused(status, why.into())
    }

    fn input(why: impl ToString) -> Refused {
        Refused(StatusCode::UNPROCESSABLE_ENTITY, why.to_string())
    }
}

type Answer = Response<Full<Bytes>>;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Edits {
    edits: Vec<Edit>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SaveAs {
    name: String,
}

impl Answering {
    /// Answers the requests of a session.
    pub fn new(session: Arc<Session>, guard: Guard, patience: Patience) -> Answering {
        Answering {
            session,
            guard,
            patience,
            weaving: Semaphore::new(1),
        }
    }

    /// Whether a request comes from a page of this session.
    pub(crate) fn is_own<B>(&self, request: &Request<B>) -> bool {
        let checked = self.guard.check(request.headers(), request.uri().path());
        checked.is_ok()
    }

    /// Answers a request: with what it asks for, or with why not.
    pub async fn answer<B>(&self, request: Request<B>) -> Answer
    where
        B: Body,
        B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        let is_head = request.method() == Method::HEAD;
        let mut answer = match self.route(request).await {
            Ok(answer) => answer,
            Err(Refused(status, why)) => {
                let mut answer = json(&json!({ "error": why }));
                *answer.status_mut() = status;
                answer
            }
        };
        if is_head {
            *answer.body_mut() = Full::default();
        }
        guarded(&mut answer);
        answer
    }

    async fn route<B>(&self, request: Request<B>) -> Result<Answer, Refused>
    where
        B: Body,
        B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        let uri = request.uri().clone();
        let checked = self.guard.check(request.headers(), uri.path());
        let path = checked.map_err(|refusal| match refusal {
            Refusal::Token => Refused::new(StatusCode::NOT_FOUND, "there is nothing here"),
            _ => Refused::new(
                StatusCode::FORBIDDEN,
                "this page is for its own address only",
            ),
        })?;
        let query = uri.query().unwrap_or("");
        let method = request.method().clone();
        let is_get = method == Method::GET || method == Method::HEAD;
        match (is_get, method == Method::POST, path) {
            (true, _, "news") => self.news(query).await,
            (true, _, "picture.png") => self.picture(),
            (true, _, path) => match asset(path) {
                Some(asset) => Ok(answer(asset.media_type, asset.text)),
                None => Err(Refused::new(StatusCode::NOT_FOUND, "there is nothing here")),
            },
            (_, true, "edit") => {
                let Edits { edits } = self.json(request).await?;
                let revision = self.session.change(&edits);
                self.revision(revision.map_err(|e| self.wrong(&e.to_string()))?)
            }
            (_, true, "undo") => self.revision(self.session.step(true)),
            (_, true, "redo") => self.revision(self.session.step(false)),
            (_, true, "save") => {
                let SaveAs { name } = self.json(request).await?;
                self.save(name).await
            }
            (_, true, "draft") => self.draft(query, request).await,
            _ => Err(Refused::new(
                StatusCode::METHOD_NOT_ALLOWED,
                "this cannot be done here",
            )),
        }
    }

    /// A message as pages show it.
    fn wrong(&self, message: &str) -> Refused {
        Refused::input(self.session.document().0.in_words(message))
    }

    fn revision(&self, revision: u64) -> Result<Answer, Refused> {
        Ok(json(&json!({ "revision": revision })))
    }

    /// What has happened after `after=N`; with the document unless its revision is `known=N`.
    async fn news(&self, query: &str) -> Result<Answer, Refused> {
        let after = number(query, "after")?.unwrap_or(0);
        let known = number(query, "known")?;
        // A number of another session is ahead of this one's.
        if after <= self.session.serial() {
            self.session.news_after(after, self.patience.news).await;
        }
        let serial = self.session.serial();
        let (document, revision, steps) = self.session.document();
        let described = match known == Some(revision) {
            true => Value::Null,
            false => describe::document(&document, revision, steps),
        };
        Ok(json(&json!({
            "serial": serial,
            "news": self.session.news(),
            "document": described,
        })))
    }

    fn picture(&self) -> Result<Answer, Refused> {
        let (picture, number) = self.session.picture();
        if number == 0 {
            return Err(Refused::new(
                StatusCode::NOT_FOUND,
                "there is no picture yet",
            ));
        }
        let mut found = answer("image/png", picture);
        let name = HeaderName::from_static("x-picture");
        found.headers_mut().insert(name, HeaderValue::from(number));
        Ok(found)
    }

    async fn save(&self, name: String) -> Result<Answer, Refused> {
        check_name(&name).map_err(Refused::input)?;
        let saved = self.session.save(name);
        match tokio::time::timeout(self.patience.picture, saved).await {
            Ok(Ok(Ok(files))) => Ok(json(&json!({ "files": files }))),
            Ok(Ok(Err(why))) => Err(self.wrong(&why)),
            Ok(Err(_)) => Err(Refused::input("the picture was not finished")),
            Err(_) => Err(Refused::input("there is no picture yet; try again later")),
        }
    }

    /// A draft in the place of the fabric `fabric=N`, called `name=STEM`.
    async fn draft<B>(&self, query: &str, request: Request<B>) -> Result<Answer, Refused>
    where
        B: Body,
        B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        let fabric = number(query, "fabric")?.unwrap_or(0) as usize;
        let stem = value(query, "name").unwrap_or("draft").to_owned();
        check_name(&stem).map_err(Refused::input)?;
        let bytes = self.body(request, MAX_DRAFT_BYTES).await?;
        let Some(old) = self.session.document().0.fabrics.get(fabric).cloned() else {
            return Err(Refused::input("the scene has no fabric to take a draft"));
        };
        let _turn = self.weaving.acquire().await;
        let woven = tokio::task::spawn_blocking(move || opening::of_dropped(&old, &stem, &bytes));
        let woven = woven.await.map_err(|_| {
            let why = "the draft made organza stop: this is a defect of it";
            Refused::new(StatusCode::INTERNAL_SERVER_ERROR, why)
        })?;
        let made = woven.map_err(|e| self.wrong(&e.to_string()))?;
        let revision = self.session.put_fabric(fabric, made);
        self.revision(revision.map_err(Refused::input)?)
    }

    /// The body of a request as JSON, which no form of another page can send.
    async fn json<B, T>(&self, request: Request<B>) -> Result<T, Refused>
    where
        B: Body,
        B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
        T: serde::de::DeserializeOwned,
    {
        let media_type = request.headers().get(header::CONTENT_TYPE);
        if media_type.is_none_or(|media_type| media_type != "application/json") {
            let why = "expected Content-Type: application/json";
            return Err(Refused::new(StatusCode::UNSUPPORTED_MEDIA_TYPE, why));
        }
        let bytes = self.body(request, MAX_JSON_BYTES).await?;
        serde_json::from_slice(&bytes)
            .map_err(|e| Refused::new(StatusCode::BAD_REQUEST, format!("the request: {e}")))
    }

    /// The body of a request, in time and of at most so many bytes.
    async fn body<B>(&self, request: Request<B>, most: usize) -> Result<Bytes, Refused>
    where
        B: Body,
        B::Error: Into<Box<dyn std::error::Error + Send + Sync>>,
    {
        let too_large = || {
            let why = format!("expected at most {most} bytes");
            Refused::new(StatusCode::PAYLOAD_TOO_LARGE, why)
        };
        if request.body().size_hint().lower() > most as u64 {
            return Err(too_large());
        }
        let body = Box::pin(Limited::new(request.into_body(), most).collect());
        match tokio::time::timeout(self.patience.body, body).await {
            Ok(Ok(body)) => Ok(body.to_bytes()),
            Ok(Err(e)) if e.is::<http_body_util::LengthLimitError>() => Err(too_large()),
            Ok(Err(_)) => Err(Refused::new(
                StatusCode::BAD_REQUEST,
                "the request broke off",
            )),
            Err(_) => Err(Refused::new(
                StatusCode::REQUEST_TIMEOUT,
                "the request took too long",
            )),
        }
    }
}

/// The value of a name in a query, as it stands.
fn value<'a>(query: &'a str, name: &str) -> Option<&'a str> {
    let pairs = query.split('&').filter_map(|pair| pair.split_once('='));
    pairs
        .into_iter()
        .find(|(key, _)| *key == name)
        .map(|(_, value)| value)
}

fn number(query: &str, name: &str) -> Result<Option<u64>, Refused> {
    let Some(text) = value(query, name) else {
        return Ok(None);
    };
    text.parse().map(Some).map_err(|_| {
        let why = format!("{name}: expected a whole number");
        Refused::new(StatusCode::BAD_REQUEST, why)
    })
}

fn answer(media_type: &'static str, body: impl Into<Bytes>) -> Answer {
    let mut answer = Response::new(Full::new(body.into()));
    let media_type = HeaderValue::from_static(media_type);
    answer
        .headers_mut()
        .insert(header::CONTENT_TYPE, media_type);
    answer
}

fn json(value: &Value) -> Answer {
    answer("application/json", value.to_string())
}

/// Headers of every answer: nothing is kept, nothing from elsewhere is loaded, no other page
/// shows it in a frame, and its address is given to nobody.
fn guarded(answer: &mut Answer) {
    const HEADERS: [(&str, &str); 7] = [
        (
            "content-security-policy",
            "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' blob:; \
             connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
        ),
        ("cache-control", "no-store"),
        ("cross-origin-opener-policy", "same-origin"),
        ("cross-origin-resource-policy", "same-origin"),
        ("referrer-policy", "no-referrer"),
        ("x-content-type-options", "nosniff"),
        ("x-frame-options", "DENY"),
    ];
    for (name, value) in HEADERS {
        let name = HeaderName::from_static(name);
        answer
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
}
