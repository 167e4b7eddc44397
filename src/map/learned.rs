//! Maps of learned descriptors: where those come from, and what they go through (method 2.2).

use std::hash::Hasher;

use serde_json::Value;

use super::{Map, Recipe};
use crate::dtype::Dtype;
use crate::error::Error;
use crate::numbers::View;
use crate::post::{ChainState, Post};

/// The longest recipe, in bytes: however it is written, the header of a file has room for it.
const LONGEST_RECIPE: usize = 1 << 20;

impl Map {
    /// The same map, whose rows are what `post` made of the references. Each query goes through it
    /// before it is compared: from now on, descriptors of [`Post::input`] numbers are what is
    /// pushed, matched, and asked the distances of.
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
    /// [`Error::Option`] for a map of other than ready float32 descriptors, [`Error::Length`] where
    /// `post` gives another length than the map's.
    pub fn with_post(mut self, post: Post) -> Result<Self, Error> {
        if self.dtype() != Dtype::F32 || self.recipe != Recipe::Ready {
            return Err(Error::Option {
                name: "post",
                expected: "a map of ready float32 descriptors".to_owned(),
                got: match self.recipe {
                    Recipe::Ready => format!("one of {}", self.dtype()),
                    Recipe::Sad(_) => "one of SAD descriptors".to_owned(),
                },
            });
        }
        if post.output() != self.dim {
            let (what, expected, got) = ("post: what it gives", self.dim, post.output());
            return Err(Error::Length { what, expected, got });
        }
        // A chain without steps is none.
        self.post = (!post.fitted_steps().is_empty()).then(|| post.into());
        Ok(self)
    }

    /// What queries go through, where there is something.
    pub fn post(&self) -> Option<&Post> {
        self.post.as_deref()
    }

    /// How many numbers a query has: before post-processing, where there is some.
    pub fn input_dim(&self) -> usize {
        self.post.as_ref().map_or(self.dim, |post| post.input())
    }

    /// The same map with the recipe of its descriptors, which somebody else computes: a JSON object
    /// with a `name`, and what else is needed to make them again, in at most 1 MiB. It is kept in
    /// the file and means nothing to this library.
    ///
    /// # Errors
    /// [`Error::Option`] unless it is that, and for a map of SAD descriptors, which has its recipe.
    pub fn with_learned_recipe(mut self, recipe: &str) -> Result<Self, Error> {
        let refused = |got: String| Error::Option {
            name: "recipe",
            expected: "a JSON object with a \"name\", for a map of ready descriptors".to_owned(),
            got,
        };
        if self.recipe != Recipe::Ready {
            return Err(refused("a map of SAD descriptors".to_owned()));
        }
        if recipe.len() > LONGEST_RECIPE {
            return Err(refused(format!(
                "{} bytes, where {LONGEST_RECIPE} are the most",
                recipe.len()
            )));
        }
        // As deep as in the file, which must be read again.
        let [parsed]: [Value; 1] =
            serde_json::from_str(&format!("[{recipe}]")).map_err(|e| refused(e.to_string()))?;
        if !is_recipe(&parsed) {
            return Err(refused(recipe.chars().take(80).collect()));
        }
        self.learned = Some(recipe.into());
        Ok(self)
    }

    /// The recipe of descriptors that somebody else computes, where it is known: JSON.
    pub fn learned_recipe(&self) -> Option<&str> {
        self.learned.as_deref()
    }

    /// The descriptor after post-processing, which takes place in `through`; where the map has
    /// none, as it came.
    pub(crate) fn passed<'a>(
        &self,
        descriptor: View<'a>,
        through: Option<&'a mut ChainState>,
    ) -> Result<View<'a>, Error> {
        let (Some(post), Some(through)) = (&self.post, through) else { return Ok(descriptor) };
        match descriptor {
            View::F32(vector) => Ok(View::F32(post.pass(vector, through)?)),
            other => {
                let (what, map, got) = ("descriptor", Dtype::F32, other.dtype());
                Err(Error::Dtype { what, map, or_float: false, got })
            }
        }
    }
}

/// Whether it says what the descriptor is called.
pub(super) fn is_recipe(recipe: &Value) -> bool {
    recipe.get("name").is_some_and(Value::is_string)
}

/// Takes in all that decides what comes out.
pub(super) fn hash(post: &Post, hash: &mut impl Hasher) {
    hash.write(format!("{:?}", post.steps()).as_bytes());
    for stage in post.fitted_steps() {
        stage.offset.iter().chain(&stage.scale).for_each(|x| hash.write_u64(x.to_bits()));
        stage.matrix.iter().for_each(|x| hash.write_u32(x.to_bits()));
    }
}
