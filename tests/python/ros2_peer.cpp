// A node as other implementations of DDS make one, with Fast DDS and its encoding, for
// python/tests/test_ros2.py:
//   ros2_peer DOMAIN NAMESPACE
// Prints the samples that it receives, one line each: TOPIC FRAME NUMBERS AND TEXTS, in the order of the
// message. Writes what standard input commands; the frame - is none:
//   force FRAME 6 numbers     state TEXT     pose FRAME 7 numbers
//   plate HEIGHT [CELLS]      newer HEIGHT: a later version of the message
//   broken: a vertex is not a number     beyond: a triangle names a vertex that is not there
#include <fastcdr/Cdr.h>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <functional>
#include <iostream>
#include <map>
#include <memory>
#include <mutex>
#include <sstream>
#include <string>
#include <vector>

namespace fast = eprosima::fastdds::dds;
namespace rtps = eprosima::fastrtps::rtps;
using eprosima::fastcdr::Cdr;
using eprosima::fastcdr::FastBuffer;

namespace {

/// One encoded sample, with its encapsulation header.
using Bytes = std::vector<char>;

/// A type of ROS 2 whose samples are bytes.
class Type : public fast::TopicDataType {
 public:
  explicit Type(const std::string& name) {
    setName(name.c_str());
    m_typeSize = 1U << 20U;
  }
  bool serialize(void* data, rtps::SerializedPayload_t* payload) override {
    const Bytes& bytes = *static_cast<Bytes*>(data);
    if (bytes.size() > payload->max_size) return false;
    std::memcpy(payload->data, bytes.data(), bytes.size());
    payload->length = static_cast<std::uint32_t>(bytes.size());
    payload->encapsulation = CDR_LE;
    return true;
  }
  bool deserialize(rtps::SerializedPayload_t* payload, void* data) override {
    static_cast<Bytes*>(data)->assign(payload->data, payload->data + payload->length);
    return true;
  }
  std::function<std::uint32_t()> getSerializedSizeProvider(void* data) override {
    return [data] { return static_cast<std::uint32_t>(static_cast<Bytes*>(data)->size()); };
  }
  void* createData() override { return new Bytes; }
  void deleteData(void* data) override { delete static_cast<Bytes*>(data); }
  bool getKey(void*, rtps::InstanceHandle_t*, bool) override { return false; }
};

/// Prints the content of a message, whose layout is a word: h header, d double, i int32, b bool, s string,
/// and f I S D for sequences of float, int32, string and double; T the transforms of /tf.
class Printer {
 public:
  explicit Printer(Bytes& bytes)
      : buffer_(bytes.data(), bytes.size()), cdr_(buffer_, Cdr::DEFAULT_ENDIAN, Cdr::DDS_CDR) {
    cdr_.read_encapsulation();
  }
  void print(std::ostream& out, const std::string& layout) {
    for (const char kind : layout) {
      switch (kind) {
        case 'h':
          read<std::int32_t>(), read<std::uint32_t>(), out << " " << text();
          break;
        case 'd':
          out << " " << read<double>();
          break;
        case 'i':
          out << " " << read<std::int32_t>();
          break;
        case 'b':
          out << " " << read<bool>();
          break;
        case 's':
          out << " " << text();
          break;
        case 'f':
          sequence(out, "x");
          break;
        case 'x':
          out << " " << read<float>();
          break;
        case 'I':
          sequence(out, "i");
          break;
        case 'S':
          sequence(out, "s");
          break;
        case 'D':
          sequence(out, "d");
          break;
        case 'T':
          sequence(out, "hsddddddd");
          break;
        default:
          std::abort();
      }
    }
  }

 private:
  template <class Value>
  Value read() {
    Value value;
    cdr_ >> value;
    return value;
  }
  std::string text() {
    const auto value = read<std::string>();
    return value.empty() ? "-" : value;
  }
  void sequence(std::ostream& out, const std::string& element) {
    for (auto count = read<std::uint32_t>(); count > 0; --count) print(out, element);
  }

  FastBuffer buffer_;
  Cdr cdr_;
};

std::mutex output;

class Reader : public fast::DataReaderListener {
 public:
  Reader(std::string name, std::string layout) : name_(std::move(name)), layout_(std::move(layout)) {}

  void on_data_available(fast::DataReader* reader) override {
    Bytes bytes;
    fast::SampleInfo info;
    while (reader->take_next_sample(&bytes, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      std::ostringstream line;
      line.precision(12);
      Printer(bytes).print(line, layout_);
      const std::lock_guard lock(output);
      std::cout << name_ << line.str() << "\n" << std::flush;
    }
  }

 private:
  std::string name_;
  std::string layout_;
};

class Node {
 public:
  Node(std::uint32_t domain, std::string nameSpace) : nameSpace_(std::move(nameSpace)) {
    fast::DomainParticipantQos qos;
    // As ROS_LOCALHOST_ONLY=1 has it.
    auto loopback = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    loopback->interfaceWhiteList.emplace_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(loopback);
    participant_ = fast::DomainParticipantFactory::get_instance()->create_participant(domain, qos);
    if (participant_ == nullptr) std::exit(1);
    publisher_ = participant_->create_publisher(fast::PUBLISHER_QOS_DEFAULT);
    subscriber_ = participant_->create_subscriber(fast::SUBSCRIBER_QOS_DEFAULT);
  }

  ~Node() {
    participant_->delete_contained_entities();
    fast::DomainParticipantFactory::get_instance()->delete_participant(participant_);
  }
  Node(const Node&) = delete;
  Node& operator=(const Node&) = delete;

  /// As ROS 2 subscribes by default: reliable, volatile. Sensor data: best effort.
  void read(const std::string& name, const std::string& type, const std::string& layout,
            bool reliable = true) {
    readers_.push_back(std::make_unique<Reader>(name, layout));
    fast::DataReaderQos qos;
    qos.reliability().kind = reliable ? fast::RELIABLE_RELIABILITY_QOS : fast::BEST_EFFORT_RELIABILITY_QOS;
    subscriber_->create_datareader(topic(name, type), qos, readers_.back().get());
  }

  /// As ROS 2 publishes by default: reliable, volatile.
  fast::DataWriter* writer(const std::string& name, const std::string& type) {
    fast::DataWriterQos qos;
    qos.reliability().kind = fast::RELIABLE_RELIABILITY_QOS;
    qos.endpoint().history_memory_policy = rtps::DYNAMIC_RESERVE_MEMORY_MODE;
    return publisher_->create_datawriter(topic(name, type), qos);
  }

 private:
  fast::Topic* topic(const std::string& name, const std::string& type) {
    fast::TypeSupport support(new Type(type));
    support.register_type(participant_);
    return participant_->create_topic("rt" + (name[0] == '/' ? name : nameSpace_ + "/" + name), type,
                                      fast::TOPIC_QOS_DEFAULT);
  }

  std::string nameSpace_;
  fast::DomainParticipant* participant_;
  fast::Publisher* publisher_;
  fast::Subscriber* subscriber_;
  std::vector<std::unique_ptr<Reader>> readers_;
};

/// A message in the making.
class Message {
 public:
  Message() : cdr_(buffer_, Cdr::LITTLE_ENDIANNESS, Cdr::DDS_CDR) { cdr_.serialize_encapsulation(); }
  Message& header(const std::string& frame) {
    return *this << std::int32_t{0} << std::uint32_t{0} << (frame == "-" ? "" : frame);
  }
  template <class Value>
  Message& operator<<(const Value& value) {
    cdr_ << value;
    return *this;
  }
  void write(fast::DataWriter* writer) {
    Bytes bytes(cdr_.getBufferPointer(), cdr_.getBufferPointer() + cdr_.getSerializedDataLength());
    writer->write(&bytes);
  }

 private:
  FastBuffer buffer_;
  Cdr cdr_;
};

// A square of 80 mm at this height along z, of cells x cells squares of two triangles. The newer version of
// the message ends with the colours and normals of its vertices.
struct Plate {
  double height = 0;
  std::uint32_t cells = 1;
  std::uint32_t lastVertex = 0;  // in place of the first one of the last triangle
  bool newer = false;

  void write(fast::DataWriter* writer) const {
    Message message;
    message << 2 * cells * cells;
    for (std::uint32_t i = 0; i < cells * cells; ++i) {
      const std::uint32_t a = i / cells * (cells + 1) + i % cells;
      const std::uint32_t b = a + cells + 1;
      const bool last = lastVertex > 0 && i + 1 == cells * cells;
      for (const std::uint32_t corner : {a, a + 1, b, last ? lastVertex : a + 1, b + 1, b}) message << corner;
    }
    const std::uint32_t vertices = (cells + 1) * (cells + 1);
    message << vertices;
    const double step = 0.08 / cells;
    for (std::uint32_t row = 0; row <= cells; ++row)
      for (std::uint32_t column = 0; column <= cells; ++column)
        message << step * column - 0.04 << step * row - 0.04 << height;
    if (newer) {
      message << vertices;
      for (std::uint32_t i = 0; i < 4 * vertices; ++i) message << 0.5F;
      message << vertices;
      for (std::uint32_t i = 0; i < 3 * vertices; ++i) message << 1.0;
    }
    message.write(writer);
  }
};

}  // namespace

int main(int count, char** arguments) {
  if (count != 3) {
    std::cerr << "ros2_peer DOMAIN NAMESPACE\n";
    return 2;
  }
  Node node(static_cast<std::uint32_t>(std::atoi(arguments[1])), arguments[2]);
  const auto type = [](const std::string& package, const std::string& name) {
    return package + "::msg::dds_::" + name + "_";
  };
  node.read("measured_cp", type("geometry_msgs", "PoseStamped"), "hddddddd", false);
  node.read("measured_cv", type("geometry_msgs", "TwistStamped"), "hdddddd");
  node.read("measured_cf", type("geometry_msgs", "WrenchStamped"), "hdddddd");
  node.read("proxy/measured_cp", type("geometry_msgs", "PoseStamped"), "hddddddd");
  node.read("contact/depth", type("std_msgs", "Float64"), "d");
  node.read("contact/object", type("std_msgs", "Int32"), "i");
  node.read("buttons", type("sensor_msgs", "Joy"), "hfI");
  node.read("gripper/measured_js", type("sensor_msgs", "JointState"), "hSDDD");
  node.read("operating_state", type("crtk_msgs", "OperatingState"), "hsbb");
  node.read("/tf", type("tf2_msgs", "TFMessage"), "T");
  auto* force = node.writer("servo_cf", type("geometry_msgs", "WrenchStamped"));
  auto* state = node.writer("state_command", type("crtk_msgs", "StringStamped"));
  auto* mesh = node.writer("part/mesh", type("shape_msgs", "Mesh"));
  auto* pose = node.writer("part/pose", type("geometry_msgs", "PoseStamped"));

  for (std::string line; std::getline(std::cin, line);) {
    std::istringstream words(line);
    std::string command;
    std::string frame;
    words >> command;
    if (command == "plate" || command == "newer") {
      Plate plate{.newer = command == "newer"};
      words >> plate.height >> plate.cells;
      plate.cells = std::max(plate.cells, 1U);  // 0 where nothing was given
      plate.write(mesh);
    } else if (command == "broken") {
      Plate{.height = std::nan("")}.write(mesh);
    } else if (command == "beyond") {
      Plate{.lastVertex = 4}.write(mesh);
    } else {
      words >> frame;
      Message message;
      message.header(command == "state" ? "-" : frame);
      if (command == "state") message << frame;
      double value = 0;
      for (std::string word; words >> word;) message << (value = std::strtod(word.c_str(), nullptr));
      message.write(command == "state" ? state : command == "force" ? force : pose);
    }
  }
  return 0;
}
