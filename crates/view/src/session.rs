//! One session: the document that all its pages show, its history, and the newest picture.

use crate::document::{Document, FabricDocument};
use crate::edit::{self, Edit};
use crate::news::News;
use hyper::body::Bytes;
use organza_scene::InputError;
use std::collections::{BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use tokio::sync::{oneshot, watch};

/// Steps that can be undone.
const MAX_STEPS: usize = 50;

/// Saves that wait for a picture at most.
const MAX_SAVES: usize = 4;

/// What a save is to be called, and who waits for it.
pub(crate) struct Save {
    pub name: String,
    pub reply: oneshot::Sender<Result<Vec<String>, String>>,
}

struct Shown {
    document: Document,
    revision: u64,
    /// The revision when more than the camera was last changed.
    settings_revision: u64,
    past: VecDeque<Document>,
    future: Vec<Document>,
    news: News,
    picture: Bytes,
    saves: VecDeque<Save>,
    /// Files that this session has written.
    saved: BTreeSet<PathBuf>,
}

/// What pages and the render share.
pub struct Session {
    shown: Mutex<Shown>,
    /// Wakes the render.
    work: Condvar,
    /// Wakes requests that wait for news; counts them.
    serial: watch::Sender<u64>,
    /// The revision that is to be shown.
    wanted: AtomicU64,
    is_over: AtomicBool,
}

/// A document to show.
pub(crate) struct Task {
    pub document: Document,
    pub revision: u64,
    pub settings_revision: u64,
}

/// What the render does next.
pub(crate) enum Work {
    Show(Box<Task>),
    Save(Save),
    End,
}

impl Session {
    /// A session that shows a document.
    pub fn new(document: Document) -> Session {
        Session {
            shown: Mutex::new(Shown {
                document,
                revision: 1,
                settings_revision: 1,
                past: VecDeque::new(),
                future: Vec::new(),
                news: News::default(),
                picture: Bytes::new(),
                saves: VecDeque::new(),
                saved: BTreeSet::new(),
            }),
            work: Condvar::new(),
            serial: watch::Sender::new(1),
            wanted: AtomicU64::new(1),
            is_over: AtomicBool::new(false),
        }
    }

    fn locked(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Ends the render and every request that waits.
    pub fn end(&self) {
        self.is_over.store(true, Ordering::Relaxed);
        drop(self.locked());
        self.work.notify_all();
        self.announce();
    }

    /// Whether it has ended.
    pub fn is_over(&self) -> bool {
        self.is_over.load(Ordering::Relaxed)
    }

    /// Whether a render of this revision is still wanted.
    pub(crate) fn is_wanted(&self, revision: u64) -> bool {
        self.wanted.load(Ordering::Relaxed) == revision && !self.is_over()
    }

    fn announce(&self) {
        self.serial.send_modify(|serial| *serial += 1);
    }

    /// The number of the newest news.
    pub fn serial(&self) -> u64 {
        *self.serial.borrow()
    }

    /// Waits until there is news after `serial`, at most so long.
    pub async fn news_after(&self, serial: u64, patience: Duration) {
        let mut newest = self.serial.subscribe();
        let later = newest.wait_for(|&now| now > serial || self.is_over());
        let _ = tokio::time::timeout(patience, later).await;
    }

    /// The document, its revision, and how many steps can be undone and done again.
    pub fn document(&self) -> (Document, u64, [usize; 2]) {
        let shown = self.locked();
        let steps = [shown.past.len(), shown.future.len()];
        (shown.document.clone(), shown.revision, steps)
    }

    /// The revision of the document.
    pub fn revision(&self) -> u64 {
        self.locked().revision
    }

    /// The news of the render.
    pub fn news(&self) -> News {
        self.locked().news.clone()
    }

    /// The newest picture as PNG, empty if there is none, and its number.
    pub fn picture(&self) -> (Bytes, u64) {
        let shown = self.locked();
        (shown.picture.clone(), shown.news.picture)
    }

    /// Makes changes, all or none. Returns the new revision.
    ///
    /// # Errors
    /// Names the key or the place that is wrong; nothing is changed.
    pub fn change(&self, edits: &[Edit]) -> Result<u64, InputError> {
        let mut shown = self.locked();
        let changed = edit::changed(&shown.document, edits)?;
        let is_step = !edits.iter().all(edit::moves_camera);
        Ok(self.show(&mut shown, changed, is_step))
    }

    /// Shows another fabric in the place of one of the document's. Returns the new revision.
    ///
    /// # Errors
    /// There is no such fabric; nothing is changed.
    pub fn put_fabric(&self, fabric: usize, new: FabricDocument) -> Result<u64, InputError> {
        let mut shown = self.locked();
        let changed = crate::opening::with_fabric(&shown.document, fabric, new)?;
        Ok(self.show(&mut shown, changed, true))
    }

    fn show(&self, shown: &mut Shown, document: Document, is_step: bool) -> u64 {
        let old = std::mem::replace(&mut shown.document, document);
        if is_step {
            shown.past.push_back(old);
            if shown.past.len() > MAX_STEPS {
                shown.past.pop_front();
            }
            shown.future.clear();
        }
        self.next_revision(shown, is_step)
    }

    fn next_revision(&self, shown: &mut Shown, is_step: bool) -> u64 {
        shown.revision += 1;
        if is_step {
            shown.settings_revision = shown.revision;
        }
        self.wanted.store(shown.revision, Ordering::Relaxed);
        self.work.notify_all();
        self.announce();
        shown.revision
    }

    /// Takes a step back, or does it again. Returns the new revision; the old one where
    /// there is no such step.
    pub fn step(&self, is_back: bool) -> u64 {
        let shown = &mut *self.locked();
        let next = match is_back {
            true => shown.past.pop_back(),
            false => shown.future.pop(),
        };
        let Some(next) = next else {
            return shown.revision;
        };
        let old = std::mem::replace(&mut shown.document, next);
        match is_back {
            true => shown.future.push(old),
            false => shown.past.push_back(old),
        }
        self.next_revision(shown, true)
    }

    /// Asks the render to save what it shows; the answer holds the names of the files.
    pub(crate) fn save(&self, name: String) -> oneshot::Receiver<Result<Vec<String>, String>> {
        let (reply, answer) = oneshot::channel();
        let mut shown = self.locked();
        if shown.saves.len() >= MAX_SAVES {
            let _ = reply.send(Err("too many saves are waiting for a picture".into()));
        } else {
            shown.saves.push_back(Save { name, reply });
            self.work.notify_all();
        }
        answer
    }

    /// Whether this session has written a file.
    pub(crate) fn has_saved(&self, path: &Path) -> bool {
        self.locked().saved.contains(path)
    }

    pub(crate) fn note_saved(&self, paths: impl Iterator<Item = PathBuf>) {
        self.locked().saved.extend(paths);
    }

    /// The next save that waits.
    pub(crate) fn next_save(&self) -> Option<Save> {
        self.locked().saves.pop_front()
    }

    /// Waits for something to do: a document of a revision other than `done`, or a save
    /// where `can_save`.
    pub(crate) fn next_work(&self, done: u64, can_save: bool) -> Work {
        let mut shown = self.locked();
        loop {
            if self.is_over() {
                return Work::End;
            }
            if shown.revision != done {
                return Work::Show(Box::new(Task {
                    document: shown.document.clone(),
                    revision: shown.revision,
                    settings_revision: shown.settings_revision,
                }));
            }
            if !can_save {
                // There is no picture of this document, and none will come.
                for save in shown.saves.drain(..) {
                    let _ = save.reply.send(Err("there is no picture to save".into()));
                }
            }
            if let Some(save) = shown.saves.pop_front() {
                return Work::Save(save);
            }
            shown = self
                .work
                .wait(shown)
                .unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Changes the news, and wakes those that wait.
    pub(crate) fn tell(&self, change: impl FnOnce(&mut News)) {
        change(&mut self.locked().news);
        self.announce();
    }

    /// Shows a picture, with the news of it.
    pub(crate) fn publish(&self, png: Bytes, change: impl FnOnce(&mut News)) {
        let mut shown = self.locked();
        shown.picture = png;
        shown.news.picture += 1;
        change(&mut shown.news);
        drop(shown);
        self.announce();
    }
}
