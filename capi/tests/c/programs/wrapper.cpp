/* surefix.hpp: what it adds to surefix.h. wrapper MAP READY FOLDER
 *
 * MAP takes images, READY float descriptors. */

#include <surefix.hpp>

#include <cstdio>
#include <fstream>
#include <iterator>
#include <memory>
#include <type_traits>

namespace {

int failures = 0;

void holds(bool fact, const char *what) {
  if (!fact) {
    std::fprintf(stderr, "not so: %s\n", what);
    ++failures;
  }
}
#define HOLDS(fact) holds((fact), #fact)

template <typename Work> surefix_status status(Work work) {
  try {
    work();
  } catch (const surefix::Error &error) {
    return *error.what() == '\0' ? SUREFIX_STATUS_INTERNAL : error.status();
  }
  return SUREFIX_STATUS_OK;
}

static_assert(!std::is_copy_constructible<surefix::Map>::value, "it has one owner");
static_assert(!std::is_copy_constructible<surefix::Localizer>::value, "it has one owner");
static_assert(std::is_nothrow_move_constructible<surefix::Map>::value, "it can be returned");
static_assert(std::is_nothrow_move_constructible<surefix::Localizer>::value, "and kept");
static_assert(std::is_trivially_copyable<surefix::Fix>::value, "it is plain");

surefix::Options options() {
  surefix::Options options;
  // Options by name.
  options.set("motion", "free").set("motion.pace", 0.5);
  options.set("sequence_length", 5).set("speeds", "0.9,1,1.1");
  options.set("threads", 1);
  // The file of settings is in the place of them.
  return options;
}

std::unique_ptr<surefix::Localizer> started(const std::string &path) {
  // The map ends here; the localizer holds it.
  const surefix::Map map = surefix::Map::open_mapped(path);
  return std::unique_ptr<surefix::Localizer>(new surefix::Localizer(map, options()));
}

void images(const std::string &path) {
  const surefix::Map map = surefix::Map::open(path);
  HOLDS(map.takes_images() && map.places() == 60 && map.name(3) == "3" && map.name(60).empty());
  HOLDS(map.image_size() == std::make_pair(std::size_t(64), std::size_t(32)));
  HOLDS(map.position(3).axes == 2 && map.position(3).metres[0] == 9);
  HOLDS(status([&] { map.position(60); }) == SUREFIX_STATUS_ARGUMENT);
  const std::unique_ptr<surefix::Localizer> owner = started(path);
  surefix::Localizer localizer = std::move(*owner);
  const std::vector<std::uint8_t> pixels(64 * 32, 7);
  const surefix_image image = surefix::image(pixels.data(), 64, 32, SUREFIX_PIXELS_GREY8);
  HOLDS(localizer.push(image).frame == 0 && localizer.push(image, 1.5).speed == 1.5);
  localizer.gap();
  localizer.gap(2.0);
  const std::vector<std::uint8_t> snapshot = localizer.snapshot();
  const surefix::Options same = options();
  surefix::Localizer restored = surefix::Localizer::restore(map, snapshot, &same);
  const surefix::Fix fix = restored.push(image), other = localizer.push(image);
  HOLDS(fix.frame == 2 && fix.confidence == other.confidence && fix.place == other.place);
  localizer.reset();
  HOLDS(localizer.push(image).frame == 0);
  const surefix::Options another;
  HOLDS(status([&] { surefix::Localizer::restore(map, snapshot, &another); }) ==
        SUREFIX_STATUS_FORMAT);
  HOLDS(status([&] { surefix::Localizer::restore(map, {}); }) != SUREFIX_STATUS_OK);
  // What is moved from is an error, and no crash.
  HOLDS(status([&] { owner->push(image); }) == SUREFIX_STATUS_ARGUMENT);
}

void descriptors(const std::string &path) {
  const surefix::Map map = surefix::Map::open(path);
  surefix::Localizer localizer(map);
  std::vector<float> values(map.descriptor_size(), 0.5f);
  HOLDS(!map.takes_images() && map.image_size().first == 0 && localizer.push(values).frame == 0);
  HOLDS(localizer.push(values, 1.0).frame == 1);
  HOLDS(localizer.push(values.data(), values.size(), SUREFIX_DTYPE_F32).frame == 2);
  values.pop_back();
  HOLDS(status([&] { localizer.push(values); }) == SUREFIX_STATUS_DATA);
  HOLDS(status([&] { localizer.push(std::vector<float>()); }) != SUREFIX_STATUS_OK);
}

} // namespace

int main(int count, char **words) {
  if (count != 4) {
    return 2;
  }
  images(words[1]);
  descriptors(words[2]);
  HOLDS(status([] { surefix::Map::open("nowhere"); }) == SUREFIX_STATUS_FILE);
  HOLDS(status([] { surefix::Options().set("speed", 1); }) == SUREFIX_STATUS_ARGUMENT);
  HOLDS(status([] { surefix::Options().load("nowhere"); }) == SUREFIX_STATUS_FILE);
  const std::string file = std::string(words[3]) + "/route.toml";
  std::ofstream(file) << "[config]\nsequence_length = 3\n";
  surefix::Options read;
  read.load(file).set("weight", 0.5);
  const surefix::Map map = surefix::Map::open(words[2]);
  surefix::Localizer localizer(map, read);
  const std::vector<float> values(8, 0.5f);
  HOLDS(!localizer.push(values).has_sequence && !localizer.push(values).has_sequence);
  HOLDS(localizer.push(values).has_sequence);
  return failures == 0 ? 0 : 1;
}
