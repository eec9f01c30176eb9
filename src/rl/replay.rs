//! Replay of transitions with their histories.
//!
//! The store is a ring of *frames*: one observation each, with the action taken on it and what that
//! brought, once known. A transition is a frame with an action and the frame after it, so no
//! observation is stored twice; an episode of `T` decisions takes `T + 1` frames. Histories are read
//! off the frames before, and end where the episode began: they never reach into another episode.
//!
//! Frames lie in chunks of fixed size, so that memory grows with what is stored and a checkpoint
//! writes only chunks that changed.

use rand::{Rng, RngExt};

use crate::nn::Real;

/// Frames in one chunk.
pub const CHUNK_FRAMES: usize = 16_384;

/// Sizes of a replay.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ReplayShape {
    /// Length of an observation.
    pub observation_len: usize,
    /// Length of an action.
    pub action_len: usize,
    /// Frames kept; the oldest go first.
    pub capacity: usize,
}

/// Frames of one chunk, as flat arrays.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chunk {
    /// `[frames][observation_len]`.
    pub observations: Vec<f32>,
    /// `[frames][action_len]`; zeros where no action was taken.
    pub actions: Vec<f32>,
    /// Reward of the action.
    pub rewards: Vec<f32>,
    /// Decisions between the start of the episode and the frame.
    pub ages: Vec<u32>,
    /// What is known of the frame: [`OPEN`], [`CONTINUES`] or [`TERMINATES`].
    pub marks: Vec<u8>,
}

/// No action was taken on the frame: the newest of all, or the last of its episode.
pub const OPEN: u8 = 0;
/// An action led on to the next frame.
pub const CONTINUES: u8 = 1;
/// An action led to the next frame, which is terminal.
pub const TERMINATES: u8 = 2;

impl Chunk {
    /// Number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        self.marks.len()
    }

    /// Whether there is no frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.marks.is_empty()
    }
}

/// The ring of frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    shape: ReplayShape,
    chunks: Vec<Chunk>,
    changed: Vec<bool>,
    /// Frames pushed so far, overwritten ones included.
    pushed: u64,
}

/// A batch of transitions, in buffers that are kept from batch to batch.
///
/// Sequences are time-major `[steps][rows][observation_len]`, a row's valid steps first.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Batch<T = f32> {
    /// Number of transitions.
    pub rows: usize,
    /// Greatest length `l` of a history.
    pub history_len: usize,
    /// `o_t`: `[rows][observation_len]`.
    pub observation: Vec<T>,
    /// `a_t`: `[rows][action_len]`.
    pub action: Vec<T>,
    /// `r_{t+1}`: `[rows]`.
    pub reward: Vec<T>,
    /// 1 where bootstrapping goes on, 0 where the episode terminated: `[rows]`.
    pub continues: Vec<T>,
    /// `o_{t+1}`: `[rows][observation_len]`.
    pub next_observation: Vec<T>,
    /// `h_t^l`: `[l][rows][observation_len]`.
    pub history: Vec<T>,
    /// Valid steps of `h_t^l`: `[rows]`.
    pub history_lengths: Vec<usize>,
    /// `h_{t+1}^l`: `[l][rows][observation_len]`.
    pub next_history: Vec<T>,
    /// Valid steps of `h_{t+1}^l`: `[rows]`.
    pub next_history_lengths: Vec<usize>,
}

impl<T: Real> Batch<T> {
    /// Buffers for `rows` transitions with histories of up to `history_len` observations.
    #[must_use]
    pub fn new(shape: &ReplayShape, rows: usize, history_len: usize) -> Self {
        let (observation_len, action_len) = (shape.observation_len, shape.action_len);
        Self {
            rows,
            history_len,
            observation: vec![T::ZERO; rows * observation_len],
            action: vec![T::ZERO; rows * action_len],
            reward: vec![T::ZERO; rows],
            continues: vec![T::ZERO; rows],
            next_observation: vec![T::ZERO; rows * observation_len],
            history: vec![T::ZERO; history_len * rows * observation_len],
            history_lengths: vec![0; rows],
            next_history: vec![T::ZERO; history_len * rows * observation_len],
            next_history_lengths: vec![0; rows],
        }
    }
}

impl Replay {
    /// An empty replay.
    ///
    /// # Panics
    ///
    /// When the capacity is below two frames: a transition takes two.
    #[must_use]
    pub fn new(shape: ReplayShape) -> Self {
        assert!(shape.capacity >= 2, "a replay of {} frame(s) cannot hold a transition", shape.capacity);
        Self { shape, chunks: Vec::new(), changed: Vec::new(), pushed: 0 }
    }

    /// Restores a replay from its chunks and [`Self::pushed`]; `None` where they do not fit together.
    #[must_use]
    pub fn restore(shape: ReplayShape, chunks: Vec<Chunk>, pushed: u64) -> Option<Self> {
        let stored = pushed.min(shape.capacity as u64) as usize;
        let fits = chunks.len() == stored.div_ceil(CHUNK_FRAMES)
            && chunks.iter().enumerate().all(|(index, chunk)| {
                let frames = chunk_len(shape.capacity, index).min(stored - index * CHUNK_FRAMES);
                chunk.len() == frames
                    && chunk.observations.len() == frames * shape.observation_len
                    && chunk.actions.len() == frames * shape.action_len
                    && chunk.rewards.len() == frames
                    && chunk.ages.len() == frames
                    && chunk.marks.iter().all(|mark| *mark <= TERMINATES)
            });
        let changed = vec![false; chunks.len()];
        fits.then_some(Self { shape, chunks, changed, pushed })
    }

    /// Its sizes.
    #[must_use]
    pub fn shape(&self) -> &ReplayShape {
        &self.shape
    }

    /// Frames pushed so far, overwritten ones included.
    #[must_use]
    pub fn pushed(&self) -> u64 {
        self.pushed
    }

    /// Frames stored.
    #[must_use]
    pub fn len(&self) -> usize {
        self.pushed.min(self.shape.capacity as u64) as usize
    }

    /// Whether nothing is stored.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.pushed == 0
    }

    /// The chunks, in order of their place in the ring.
    #[must_use]
    pub fn chunks(&self) -> &[Chunk] {
        &self.chunks
    }

    /// Hands out which chunks changed since the last call.
    pub fn take_changes(&mut self) -> Vec<usize> {
        let indices = (0..self.changed.len()).filter(|&index| self.changed[index]).collect();
        self.changed.fill(false);
        indices
    }

    /// The first observation of an episode.
    ///
    /// # Panics
    ///
    /// When the observation has another length than the replay's.
    pub fn begin_episode(&mut self, observation: &[f32]) {
        self.push_frame(observation, 0);
    }

    /// The action taken on the newest observation, what it brought, and the observation that followed.
    ///
    /// # Panics
    ///
    /// When no episode has begun, or a length differs from the replay's.
    pub fn push(&mut self, action: &[f32], reward: f32, terminated: bool, next_observation: &[f32]) {
        assert!(self.pushed > 0, "an episode has to begin first");
        assert_eq!(action.len(), self.shape.action_len);
        let (chunk, at) = self.locate(self.slot(self.pushed - 1));
        self.changed[chunk] = true;
        let frames = &mut self.chunks[chunk];
        frames.actions[at * action.len()..][..action.len()].copy_from_slice(action);
        frames.rewards[at] = reward;
        frames.marks[at] = if terminated { TERMINATES } else { CONTINUES };
        let age = frames.ages[at] + 1;
        self.push_frame(next_observation, age);
    }

    /// Draws transitions uniformly, with replacement, into `batch`; `false` where there is none yet.
    pub fn sample(&self, rng: &mut impl Rng, batch: &mut Batch) -> bool {
        let oldest = self.pushed - self.len() as u64;
        if !(oldest..self.pushed).any(|frame| self.mark(frame) != OPEN) {
            return false;
        }
        for row in 0..batch.rows {
            let frame = loop {
                let frame = rng.random_range(oldest..self.pushed);
                if self.mark(frame) != OPEN {
                    break frame;
                }
            };
            self.read(frame, oldest, row, batch);
        }
        true
    }

    fn read(&self, frame: u64, oldest: u64, row: usize, batch: &mut Batch) {
        let n = self.shape.observation_len;
        let m = self.shape.action_len;
        let (chunk, at) = self.locate(self.slot(frame));
        let frames = &self.chunks[chunk];
        batch.observation[row * n..][..n].copy_from_slice(self.observation(frame));
        batch.action[row * m..][..m].copy_from_slice(&frames.actions[at * m..][..m]);
        batch.reward[row] = frames.rewards[at];
        batch.continues[row] = if frames.marks[at] == TERMINATES { 0.0 } else { 1.0 };
        batch.next_observation[row * n..][..n].copy_from_slice(self.observation(frame + 1));
        let sizes = (batch.rows, batch.history_len);
        batch.history_lengths[row] = self.read_history(frame, oldest, row, sizes, &mut batch.history);
        batch.next_history_lengths[row] =
            self.read_history(frame + 1, oldest, row, sizes, &mut batch.next_history);
    }

    /// Copies the observations before `frame` to column `row`, oldest first; tells how many.
    fn read_history(
        &self,
        frame: u64,
        oldest: u64,
        row: usize,
        (rows, history_len): (usize, usize),
        history: &mut [f32],
    ) -> usize {
        let n = self.shape.observation_len;
        let (chunk, at) = self.locate(self.slot(frame));
        let age = u64::from(self.chunks[chunk].ages[at]);
        let length = (history_len as u64).min(age).min(frame - oldest);
        for (step, earlier) in (frame - length..frame).enumerate() {
            history[(step * rows + row) * n..][..n].copy_from_slice(self.observation(earlier));
        }
        // What follows the valid steps is padding: it has to be finite, and the same every time.
        for step in length as usize..history_len {
            history[(step * rows + row) * n..][..n].fill(0.0);
        }
        length as usize
    }

    fn push_frame(&mut self, observation: &[f32], age: u32) {
        let n = self.shape.observation_len;
        assert_eq!(observation.len(), n);
        let (chunk, at) = self.locate(self.slot(self.pushed));
        if chunk == self.chunks.len() {
            self.chunks.push(self.empty_chunk(chunk));
            self.changed.push(true);
        }
        self.changed[chunk] = true;
        let frames = &mut self.chunks[chunk];
        if at == frames.len() {
            frames.observations.extend_from_slice(observation);
            frames.actions.resize((at + 1) * self.shape.action_len, 0.0);
            frames.rewards.push(0.0);
            frames.ages.push(age);
            frames.marks.push(OPEN);
        } else {
            frames.observations[at * n..][..n].copy_from_slice(observation);
            frames.actions[at * self.shape.action_len..][..self.shape.action_len].fill(0.0);
            frames.rewards[at] = 0.0;
            frames.ages[at] = age;
            frames.marks[at] = OPEN;
        }
        self.pushed += 1;
    }

    fn empty_chunk(&self, index: usize) -> Chunk {
        let frames = chunk_len(self.shape.capacity, index);
        Chunk {
            observations: Vec::with_capacity(frames * self.shape.observation_len),
            actions: Vec::with_capacity(frames * self.shape.action_len),
            rewards: Vec::with_capacity(frames),
            ages: Vec::with_capacity(frames),
            marks: Vec::with_capacity(frames),
        }
    }

    fn slot(&self, frame: u64) -> usize {
        (frame % self.shape.capacity as u64) as usize
    }

    fn locate(&self, slot: usize) -> (usize, usize) {
        (slot / CHUNK_FRAMES, slot % CHUNK_FRAMES)
    }

    fn mark(&self, frame: u64) -> u8 {
        let (chunk, at) = self.locate(self.slot(frame));
        self.chunks[chunk].marks[at]
    }

    fn observation(&self, frame: u64) -> &[f32] {
        let n = self.shape.observation_len;
        let (chunk, at) = self.locate(self.slot(frame));
        &self.chunks[chunk].observations[at * n..][..n]
    }
}

/// Frames that chunk `index` of a full ring holds.
fn chunk_len(capacity: usize, index: usize) -> usize {
    CHUNK_FRAMES.min(capacity - index * CHUNK_FRAMES)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;

    use super::*;

    /// Observations tell episode and time, so that every row of a batch can be checked by itself.
    fn filled(capacity: usize, episodes: &[usize]) -> Replay {
        let mut replay = Replay::new(ReplayShape { observation_len: 2, action_len: 1, capacity });
        for (episode, &decisions) in episodes.iter().enumerate() {
            let episode = episode as f32 + 1.0;
            replay.begin_episode(&[episode, 0.0]);
            for t in 0..decisions {
                let terminated = t + 1 == decisions && decisions % 2 == 1;
                replay.push(&[t as f32 * 0.5], t as f32, terminated, &[episode, t as f32 + 1.0]);
            }
        }
        replay
    }

    fn check_rows(replay: &Replay, history_len: usize, decisions_of: &[usize]) -> usize {
        let mut batch = Batch::new(replay.shape(), 64, history_len);
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut full = 0;
        for _ in 0..50 {
            assert!(replay.sample(&mut rng, &mut batch));
            for row in 0..batch.rows {
                let [episode, t] = [batch.observation[row * 2], batch.observation[row * 2 + 1]];
                assert_eq!(batch.action[row], t * 0.5);
                assert_eq!(batch.reward[row], t);
                assert_eq!(&batch.next_observation[row * 2..row * 2 + 2], &[episode, t + 1.0]);
                let decisions = decisions_of[episode as usize - 1];
                let terminated = t as usize + 1 == decisions && decisions % 2 == 1;
                assert_eq!(batch.continues[row], if terminated { 0.0 } else { 1.0 });
                for (history, lengths, now) in [
                    (&batch.history, &batch.history_lengths, t),
                    (&batch.next_history, &batch.next_history_lengths, t + 1.0),
                ] {
                    let length = lengths[row];
                    assert!(length <= history_len && length as f32 <= now);
                    full += usize::from(length == history_len.min(now as usize));
                    for step in 0..history_len {
                        let entry = &history[(step * batch.rows + row) * 2..][..2];
                        let expected =
                            if step < length { [episode, now - (length - step) as f32] } else { [0.0, 0.0] };
                        assert_eq!(entry, &expected);
                    }
                }
            }
        }
        full
    }

    #[test]
    fn histories_never_cross_an_episode() {
        let episodes = [3, 1, 8, 2, 5];
        let replay = filled(100, &episodes);
        assert_eq!(replay.len(), 19 + 5);
        // Nothing was overwritten, so every history is as long as its episode allows.
        assert_eq!(check_rows(&replay, 4, &episodes), 2 * 50 * 64);
    }

    #[test]
    fn a_ring_that_wrapped_within_an_episode_cuts_histories_short() {
        for capacity in 9..30 {
            let episodes = [7, 9, 6, 8];
            check_rows(&filled(capacity, &episodes), 5, &episodes);
        }
    }

    #[test]
    fn every_transition_is_drawn_equally_often() {
        let replay = filled(1000, &[4, 4]);
        let mut batch = Batch::new(replay.shape(), 8000, 2);
        replay.sample(&mut ChaCha8Rng::seed_from_u64(6), &mut batch);
        for episode in [1.0, 2.0] {
            for t in 0..4 {
                let key = [episode, t as f32];
                let count = batch.observation.chunks(2).filter(|observation| *observation == key).count();
                assert!((count as i64 - 1000).abs() < 150, "{key:?}: {count}");
            }
        }
    }

    #[test]
    fn an_empty_replay_has_nothing_to_draw() {
        let mut replay = Replay::new(ReplayShape { observation_len: 2, action_len: 1, capacity: 10 });
        let mut batch = Batch::new(replay.shape(), 2, 1);
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        assert!(!replay.sample(&mut rng, &mut batch));
        replay.begin_episode(&[0.0, 0.0]);
        assert!(!replay.sample(&mut rng, &mut batch));
    }

    /// In episodes of 500 decisions, as in open water, an observation of 43 each: the bytes really held.
    #[test]
    fn a_million_transitions_fit_in_the_memory_that_is_stated() {
        let capacity = 1_002_000;
        let mut replay = Replay::new(ReplayShape { observation_len: 43, action_len: 1, capacity });
        let observation = [0.5; 43];
        for _ in 0..2000 {
            replay.begin_episode(&observation);
            for _ in 0..500 {
                replay.push(&[0.0], 0.0, false, &observation);
            }
        }
        let transitions = replay.chunks().iter().flat_map(|chunk| &chunk.marks).filter(|mark| **mark != OPEN);
        assert_eq!(transitions.count(), 1_000_000);
        let bytes: usize = replay
            .chunks()
            .iter()
            .map(|chunk| {
                let floats =
                    chunk.observations.capacity() + chunk.actions.capacity() + chunk.rewards.capacity();
                4 * (floats + chunk.ages.capacity()) + chunk.marks.capacity()
            })
            .sum();
        assert!(bytes < 450_000_000, "{bytes}");
    }

    #[test]
    fn only_changed_chunks_are_named() {
        let shape = ReplayShape { observation_len: 1, action_len: 1, capacity: 3 * CHUNK_FRAMES };
        let mut replay = Replay::new(shape);
        replay.begin_episode(&[0.0]);
        for _ in 0..CHUNK_FRAMES {
            replay.push(&[0.0], 0.0, false, &[1.0]);
        }
        assert_eq!(replay.take_changes(), vec![0, 1]);
        replay.push(&[0.0], 0.0, false, &[2.0]);
        assert_eq!(replay.take_changes(), vec![1]);
        assert!(replay.take_changes().is_empty());
        let restored = Replay::restore(shape, replay.chunks().to_vec(), replay.pushed());
        assert_eq!(restored.as_ref().map(|restored| restored.chunks()), Some(replay.chunks()));
        assert_eq!(Replay::restore(shape, replay.chunks()[..1].to_vec(), replay.pushed()), None);
    }
}
