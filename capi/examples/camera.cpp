// Localizes a camera along a map: camera MAP FRAMES... [--settings route.toml] [--motion any]
//
// FRAMES are PNM files (P5 or P6, 8 bits), in order; they stand in for a camera. A row of numbers a
// frame goes to standard output, with all their digits.

#include <surefix.hpp>

#include <cstdio>
#include <cstring>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

// In place of the driver of a camera, or of cv::VideoCapture: its pixels lie in one buffer, which
// the next frame overwrites.
class Camera {
public:
  explicit Camera(const std::vector<std::string> &files) : files_(files) {}

  bool read() {
    if (next_ == files_.size()) {
      return false;
    }
    const std::string &name = files_[next_++];
    std::ifstream file(name, std::ios::binary);
    std::string kind;
    std::size_t levels = 0;
    file >> kind >> width_ >> height_ >> levels;
    file.get();
    colour_ = kind == "P6";
    if (!file || !(colour_ || kind == "P5") || levels != 255) {
      throw std::runtime_error(name + ": expected a PNM image, P5 or P6, of 8 bits");
    }
    pixels_.resize(width_ * height_ * (colour_ ? 3 : 1));
    file.read(pixels_.data(), static_cast<std::streamsize>(pixels_.size()));
    if (!file) {
      throw std::runtime_error(name + ": expected more pixels");
    }
    return true;
  }

  // The frame where it lies: nothing is copied. Of a cv::Mat:
  // surefix::image(frame.data, frame.cols, frame.rows, SUREFIX_PIXELS_BGR8, frame.step)
  surefix_image image() const {
    const surefix_pixels format = colour_ ? SUREFIX_PIXELS_RGB8 : SUREFIX_PIXELS_GREY8;
    return surefix::image(pixels_.data(), width_, height_, format);
  }

private:
  std::vector<std::string> files_;
  std::size_t next_ = 0, width_ = 0, height_ = 0;
  bool colour_ = false;
  std::vector<char> pixels_;
};

void localize(const std::string &path, const surefix::Options &options, Camera camera) {
  const surefix::Map map = surefix::Map::open(path);
  surefix::Localizer localizer(map, options);
  std::puts("frame,place,score,trusted,accepted,confidence,off_map,x,y");
  while (camera.read()) {
    try {
      const surefix::Fix fix = localizer.push(camera.image());
      const surefix::Position &at = fix.position;
      std::printf("%llu,%zu,%.17g,%d,%d,%.17g,%.17g,%.17g,%.17g\n",
                  static_cast<unsigned long long>(fix.frame), fix.place,
                  static_cast<double>(fix.score), fix.trusted, fix.accepted, fix.confidence,
                  fix.off_map, at.metres[0], at.metres[1]);
    } catch (const surefix::Error &error) {
      // A frame that is none is lost, as if it had not come; the localizer is as it was.
      if (error.status() != SUREFIX_STATUS_DATA || !map.takes_images()) {
        throw;
      }
      std::cerr << "camera: a frame is lost: " << error.what() << '\n';
      localizer.gap();
    }
  }
}

} // namespace

int main(int count, char **words) try {
  surefix::Options options;
  std::vector<std::string> files;
  for (int index = 1; index < count; ++index) {
    const std::string word = words[index];
    const bool named = word.compare(0, 2, "--") == 0 && index + 1 < count;
    if (named && word == "--settings") {
      options.load(words[++index]);
    } else if (named) {
      options.set(word.substr(2), words[++index]);
    } else {
      files.push_back(word);
    }
  }
  if (files.empty()) {
    std::cerr << "usage: camera MAP FRAMES... [--settings route.toml] [--motion any]\n";
    return 2;
  }
  const std::string map = files.front();
  files.erase(files.begin());
  localize(map, options, Camera(files));
  return 0;
} catch (const std::exception &error) {
  std::cerr << "camera: " << error.what() << '\n';
  return 1;
}
