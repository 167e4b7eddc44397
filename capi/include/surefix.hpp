/* surefix for C++11 and later: surefix.h with owners that cannot be copied, and exceptions. */

#ifndef SUREFIX_HPP
#define SUREFIX_HPP

#include "surefix.h"

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace surefix {

/// A call that failed; what() says what was expected and what came.
class Error : public std::runtime_error {
public:
  explicit Error(const surefix_error &error)
      : std::runtime_error(error.message), status_(error.status) {}

  /// Why: SUREFIX_STATUS_DATA, for one, if the next frame may do.
  surefix_status status() const noexcept { return status_; }

private:
  surefix_status status_;
};

namespace detail {

/// Calls a function of surefix.h with a place for its error, and throws that.
template <typename... Parameters, typename... Arguments>
void call(surefix_status (*function)(Parameters...), Arguments... arguments) {
  surefix_error error;
  if (function(arguments..., &error) != SUREFIX_STATUS_OK) {
    throw Error(error);
  }
}

struct Free {
  void operator()(surefix_map *map) const noexcept { surefix_map_free(map); }
  void operator()(surefix_options *options) const noexcept { surefix_options_free(options); }
  void operator()(surefix_localizer *localizer) const noexcept {
    surefix_localizer_free(localizer);
  }
};

template <typename T> using Owner = std::unique_ptr<T, Free>;

} // namespace detail

using Fix = surefix_fix;
using Position = surefix_position;

/// An image in the caller's memory; stride 0 if no bytes lie between its rows.
inline surefix_image image(const void *pixels, std::size_t width, std::size_t height,
                           surefix_pixels format, std::size_t stride = 0) noexcept {
  return surefix_image{pixels, width, height, stride, format};
}

/// A known route. It can be shared by localizers and threads, and may end before the localizers.
class Map {
public:
  /// Reads a map's file into memory.
  static Map open(const std::string &path) { return Map(surefix_map_open, path); }
  /// Maps it into memory instead: it must not be changed meanwhile, see surefix_map_open_mapped.
  static Map open_mapped(const std::string &path) { return Map(surefix_map_open_mapped, path); }

  std::size_t places() const noexcept { return surefix_map_places(get()); }
  std::size_t descriptor_size() const noexcept { return surefix_map_descriptor_size(get()); }
  bool takes_images() const noexcept { return surefix_map_takes_images(get()); }

  /// Width and height of the images that it was made of; 0 and 0 if they are not known.
  std::pair<std::size_t, std::size_t> image_size() const noexcept {
    std::pair<std::size_t, std::size_t> size(0, 0);
    surefix_map_image_size(get(), &size.first, &size.second);
    return size;
  }

  /// The name of a place; empty if it has none.
  std::string name(std::size_t place) const {
    const char *text = surefix_map_name(get(), place);
    return text == nullptr ? std::string() : std::string(text);
  }

  Position position(std::size_t place) const {
    Position at;
    detail::call(surefix_map_position, get(), place, &at);
    return at;
  }

  const surefix_map *get() const noexcept { return map_.get(); }

private:
  template <typename Function> Map(Function function, const std::string &path) {
    surefix_map *map = nullptr;
    detail::call(function, path.c_str(), &map);
    map_.reset(map);
  }

  detail::Owner<surefix_map> map_;
};

/// The options of a localizer, by name.
class Options {
public:
  Options() {
    surefix_options *options = nullptr;
    detail::call(surefix_options_new, &options);
    options_.reset(options);
  }

  Options &set(const std::string &name, const std::string &value) {
    detail::call(surefix_options_set, options_.get(), name.c_str(), value.c_str());
    return *this;
  }
  Options &set(const std::string &name, double value) {
    detail::call(surefix_options_set_number, options_.get(), name.c_str(), value);
    return *this;
  }

  /// The settings of a file of `surefix tune`, in place of all that was set but the threads.
  Options &load(const std::string &path) {
    detail::call(surefix_options_load, options_.get(), path.c_str());
    return *this;
  }

  const surefix_options *get() const noexcept { return options_.get(); }

private:
  detail::Owner<surefix_options> options_;
};

/// Localizes along a map, one camera frame at a time. One thread at a time may use it.
class Localizer {
public:
  explicit Localizer(const Map &map, const Options &options = Options()) {
    surefix_localizer *localizer = nullptr;
    detail::call(surefix_localizer_new, map.get(), options.get(), &localizer);
    localizer_.reset(localizer);
  }

  /// Goes on where a snapshot was taken; options are those of the snapshot, or must equal them.
  static Localizer restore(const Map &map, const std::vector<std::uint8_t> &snapshot,
                           const Options *options = nullptr) {
    surefix_localizer *localizer = nullptr;
    detail::call(surefix_localizer_restore, map.get(), options ? options->get() : nullptr,
                 snapshot.data(), snapshot.size(), &localizer);
    return Localizer(localizer);
  }

  /// Takes a frame. Of the advance, in places, see surefix_push_image.
  Fix push(const surefix_image &image) { return push_image(image, nullptr); }
  Fix push(const surefix_image &image, double advance) { return push_image(image, &advance); }

  Fix push(const std::vector<float> &values) { return push_descriptor(values, nullptr); }
  Fix push(const std::vector<float> &values, double advance) {
    return push_descriptor(values, &advance);
  }
  /// Of another type: one of surefix_dtype.
  Fix push(const void *values, std::size_t count, surefix_dtype type,
           const double *advance = nullptr) {
    Fix fix;
    detail::call(surefix_push_descriptor, get(), values, count, type, advance, &fix);
    return fix;
  }

  /// The next frame does not follow on the one before.
  void gap() { detail::call(surefix_gap, get(), nullptr); }
  void gap(double advance) { detail::call(surefix_gap, get(), &advance); }

  void reset() { detail::call(surefix_reset, get()); }

  /// The state as bytes, without the map.
  std::vector<std::uint8_t> snapshot() const {
    std::uint8_t *bytes = nullptr;
    std::size_t size = 0;
    detail::call(surefix_snapshot, get(), &bytes, &size);
    const auto end = [size](std::uint8_t *ended) { surefix_snapshot_free(ended, size); };
    const std::unique_ptr<std::uint8_t, decltype(end)> owner(bytes, end);
    return std::vector<std::uint8_t>(bytes, bytes + size);
  }

  surefix_localizer *get() const noexcept { return localizer_.get(); }

private:
  explicit Localizer(surefix_localizer *localizer) : localizer_(localizer) {}

  Fix push_image(const surefix_image &image, const double *advance) {
    Fix fix;
    detail::call(surefix_push_image, get(), &image, advance, &fix);
    return fix;
  }
  Fix push_descriptor(const std::vector<float> &values, const double *advance) {
    return push(values.data(), values.size(), SUREFIX_DTYPE_F32, advance);
  }

  detail::Owner<surefix_localizer> localizer_;
};

} // namespace surefix

#endif /* SUREFIX_HPP */
