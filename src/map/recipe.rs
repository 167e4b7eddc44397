//! How a map's descriptors were made and how they are compared.

use std::hash::Hasher;
use std::sync::Arc;

use once_cell::race::OnceBox;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Map;
use crate::descriptor::Sad;
use crate::distance::{Metric, Rows, Tuning};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::View;
use crate::post::Post;
use crate::simd::Isa;

/// The longest recipe of a learned descriptor, in bytes. The header of a file has room for it,
/// however JSON writes it.
const LONGEST_RECIPE: usize = 1 << 20;

/// How the map's descriptors were made, so that a query can be described the same way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
#[non_exhaustive]
pub enum Recipe {
    /// By another program: queries come as descriptors.
    #[default]
    Ready,
    /// The SAD descriptor: queries come as images, or as its descriptors.
    Sad(Sad),
}

/// The properties that all rows of a map share.
#[derive(Clone, Debug)]
pub(super) struct Kind {
    pub(super) dim: usize,
    pub(super) dtype: Dtype,
    pub(super) metric: Metric,
    pub(super) recipe: Recipe,
    /// The post-processing of the rows and of each query.
    pub(super) post: Option<Arc<Post>>,
    /// The recipe of a learned descriptor, as JSON.
    pub(super) learned: Option<Arc<str>>,
    /// Width and height of the images that the rows were made of.
    pub(super) image_size: Option<(usize, usize)>,
}

impl Kind {
    /// Rows of this kind, as the kernels take them: some of `all`.
    pub(super) fn rows<'a>(
        &self,
        values: View<'a>,
        norms: &'a [f64],
        isa: Isa,
        all: usize,
    ) -> Rows<'a> {
        let tuning = Tuning::of(all * self.dim * self.dtype.size());
        let unit = match self.recipe {
            Recipe::Sad(sad) => sad.unit(),
            Recipe::Ready => 1.0,
        };
        Rows { values, dim: self.dim, metric: self.metric, unit, norms, isa, tuning }
    }
}

impl Map {
    /// The same map, whose rows are the references after `post`. Each query goes through it before
    /// it is compared: from now on, queries are descriptors of [`Post::input`] numbers. A place whose
    /// reference was all zeros still [shows nothing](Self::blank).
    ///
    /// ```
    /// use surefix::{Map, Metric, Post, Step};
    /// let raw = [1.0_f32, 2.0, 3.0, 6.0, 5.0, 10.5, 8.0, 1.0];
    /// let (post, rows) = Post::fit(&[Step::Standardize, Step::Normalize], &raw, 2)?;
    /// let map = Map::from_descriptors(rows, 2, Metric::Cosine)?.with_post(post)?;
    /// assert!(map.distances(&raw[2..4])?[1] < 1e-6);
    /// # Ok::<(), surefix::Error>(())
    /// ```
    ///
    /// # Errors
    /// [`Error::Option`] unless the map has ready float32 descriptors, of one traverse, [`Error::Length`] if `post`
    /// gives another length than the map's.
    pub fn with_post(mut self, post: Post) -> Result<Self, Error> {
        if (self.dtype(), self.recipe()) != (Dtype::F32, Recipe::Ready) {
            return Err(Error::Option {
                name: "post",
                expected: "a map of ready float32 descriptors".to_owned(),
                got: match self.recipe() {
                    Recipe::Ready => format!("one of {}", self.dtype()),
                    Recipe::Sad(_) => "one of SAD descriptors".to_owned(),
                },
            });
        }
        if self.has_several() {
            return Err(Error::Option {
                name: "post",
                expected: "a map of one traverse".to_owned(),
                got: format!("one of {}", self.traverses().len()),
            });
        }
        if post.output() != self.dim() {
            let (what, expected, got) = ("post: what it gives", self.dim(), post.output());
            return Err(Error::Length { what, expected, got });
        }
        // A chain without steps is the same as no chain.
        self.kind.post = (!post.fitted_steps().is_empty()).then(|| post.into());
        self.blank = OnceBox::new();
        self.changed();
        Ok(self)
    }

    /// The post-processing of queries, if there is any.
    pub fn post(&self) -> Option<&Post> {
        self.kind.post.as_deref()
    }

    /// The length of a query: before post-processing, if there is any.
    pub fn input_dim(&self) -> usize {
        self.post().map_or(self.dim(), Post::input)
    }

    /// The same map with the recipe of its learned descriptors: a JSON object of at most 1 MiB with
    /// a `name` and whatever it takes to make the descriptors again. It is kept in the file; this
    /// library does not interpret it.
    ///
    /// # Errors
    /// [`Error::Option`] for another recipe, and for a map of SAD descriptors, which has its own.
    pub fn with_learned_recipe(mut self, recipe: &str) -> Result<Self, Error> {
        let refused = |got: String| Error::Option {
            name: "recipe",
            expected: "a JSON object with a \"name\", for a map of ready descriptors".to_owned(),
            got,
        };
        if self.recipe() != Recipe::Ready {
            return Err(refused("a map of SAD descriptors".to_owned()));
        }
        if recipe.len() > LONGEST_RECIPE {
            return Err(refused(format!("{} bytes: {LONGEST_RECIPE} are the most", recipe.len())));
        }
        // Parsed one level deeper, as it lies in the file: the parser's limit must not refuse it
        // there.
        let [parsed]: [Value; 1] =
            serde_json::from_str(&format!("[{recipe}]")).map_err(|e| refused(e.to_string()))?;
        if !is_recipe(&parsed) {
            return Err(refused(recipe.chars().take(80).collect()));
        }
        self.kind.learned = Some(recipe.into());
        Ok(self)
    }

    /// The same map, made of images of this width and height: queries of another shape are then
    /// noticed.
    ///
    /// # Errors
    /// [`Error::Option`] for a side of 0.
    pub fn with_image_size(mut self, size: Option<(usize, usize)>) -> Result<Self, Error> {
        if let Some((width, height)) = size.filter(|&(width, height)| width == 0 || height == 0) {
            let (expected, got) = ("sides above 0".to_owned(), format!("{width} x {height}"));
            return Err(Error::Option { name: "image_size", expected, got });
        }
        self.kind.image_size = size;
        Ok(self)
    }

    /// Width and height of the images that the map was made of; `None` if that is not known, or
    /// they differ.
    pub fn image_size(&self) -> Option<(usize, usize)> {
        self.kind.image_size
    }

    /// The recipe of learned descriptors as JSON, if it is known.
    pub fn learned_recipe(&self) -> Option<&str> {
        self.kind.learned.as_deref()
    }
}

/// Whether it names the descriptor.
pub(super) fn is_recipe(recipe: &Value) -> bool {
    recipe.get("name").is_some_and(Value::is_string)
}

/// Hashes everything that decides the result.
pub(super) fn hash(post: &Post, hash: &mut impl Hasher) {
    hash.write(format!("{:?}", post.steps()).as_bytes());
    for stage in post.fitted_steps() {
        stage.offset.iter().chain(&stage.scale).for_each(|x| hash.write_u64(x.to_bits()));
        stage.matrix.iter().for_each(|x| hash.write_u32(x.to_bits()));
    }
}
