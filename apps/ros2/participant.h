// DDS as this program needs it: typed writers and readers of topics as ROS 2 names them.
#pragma once

#include <dds/dds.h>

#include <cstdint>
#include <string>
#include <utility>

namespace hapticd::apps::ros2 {

/// A handle of Cyclone DDS, which deletes what it names.
class Entity {
 public:
  /// Throws std::runtime_error, "cannot create WHAT: ...", for a handle that is an error.
  Entity(dds_entity_t handle, const std::string& what);
  ~Entity();
  Entity(Entity&& other) noexcept : handle_(std::exchange(other.handle_, 0)) {}
  Entity& operator=(Entity&& other) noexcept {
    std::swap(handle_, other.handle_);
    return *this;
  }

  dds_entity_t handle() const { return handle_; }

 private:
  dds_entity_t handle_;
};

/// How a topic is delivered; readers that ask for less match, too.
enum class Delivery {
  stream,  ///< best effort for readers; writers repeat what a reliable reader has lost, of the newest samples
  state,   ///< reliable; writers keep the newest sample for readers that come later
};

/// The membership in one DDS domain, under one namespace of topics.
class Participant {
 public:
  /// Talks to this machine only, unless `network` or CYCLONEDDS_URI, Cyclone's own configuration, says
  /// otherwise. `nameSpace` is "" or begins with a slash. Throws std::runtime_error.
  Participant(std::uint32_t domain, bool network, std::string nameSpace);

  /// The ROS name of a topic: one that begins with a slash is absolute.
  std::string fullName(const std::string& name) const;

  Entity writer(const dds_topic_descriptor_t& type, const std::string& name, Delivery delivery) const;
  Entity reader(const dds_topic_descriptor_t& type, const std::string& name, Delivery delivery) const;

 private:
  Entity topic(const dds_topic_descriptor_t& type, const std::string& name) const;

  std::string nameSpace_;
  Entity domain_;
  Entity participant_;
};

template <class Message>
class Writer {
 public:
  Writer(const Participant& participant, const dds_topic_descriptor_t& type, const std::string& name,
         Delivery delivery = Delivery::stream)
      : entity_(participant.writer(type, name, delivery)) {}

  /// Does not wait for readers.
  void write(const Message& message) { dds_write(entity_.handle(), &message); }

 private:
  Entity entity_;
};

template <class Message>
class Reader {
 public:
  Reader(const Participant& participant, const dds_topic_descriptor_t& type, const std::string& name,
         Delivery delivery = Delivery::stream)
      : entity_(participant.reader(type, name, delivery)) {}

  /// Calls use(const Message&) for each sample that has arrived since the last call. Does not wait.
  template <class Use>
  void take(Use&& use) {
    void* sample = nullptr;
    dds_sample_info_t info;
    while (dds_take(entity_.handle(), &sample, &info, 1, 1) > 0) {
      const Loan loan{entity_.handle(), sample};
      if (info.valid_data) use(*static_cast<const Message*>(sample));
      sample = nullptr;
    }
  }

 private:
  struct Loan {
    dds_entity_t reader;
    void* sample;
    ~Loan() { dds_return_loan(reader, &sample, 1); }
  };

  Entity entity_;
};

}  // namespace hapticd::apps::ros2
