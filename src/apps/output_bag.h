// A bag that a tool writes. ~Bag closes it, which ends the program where the disk is full: here that is an error.
#pragma once

#include <memory>
#include <stdexcept>
#include <string>

#include <rosbag/bag.h>

namespace dccd {

class OutputBag {
 public:
  /// Throws rosbag::BagException when the file cannot be opened.
  explicit OutputBag(std::string path)
      : path_(std::move(path)), bag_(std::make_unique<rosbag::Bag>(path_, rosbag::bagmode::Write)) {
    bag_->setCompression(rosbag::compression::LZ4);
  }
  ~OutputBag() {
    try {
      close();
    } catch (const std::runtime_error&) {  // write() said it
    }
  }
  OutputBag(const OutputBag&) = delete;
  OutputBag& operator=(const OutputBag&) = delete;

  /// As rosbag::Bag's. Throws std::runtime_error that names the file where that is at fault, else what it throws: what
  /// is copied from another bag is read here.
  template <class... Arguments>
  void write(const Arguments&... arguments) {
    try {
      bag_->write(arguments...);
    } catch (const rosbag::BagException&) {
      close();
      throw;
    }
  }

  /// Throws std::runtime_error that names the file.
  void close() {
    if (!bag_) return;
    try {
      bag_->close();
    } catch (const rosbag::BagException& error) {
      [[maybe_unused]] static rosbag::Bag* volatile given_up;  // never destroyed
      given_up = bag_.release();
      throw std::runtime_error(path_ + ": cannot be written: " + error.what());
    }
  }

 private:
  std::string path_;
  std::unique_ptr<rosbag::Bag> bag_;
};

}  // namespace dccd
