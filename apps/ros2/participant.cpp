#include "participant.h"

#include <cstdlib>
#include <memory>
#include <stdexcept>

namespace hapticd::apps::ros2 {
namespace {

// Multicast would reach the network. Other processes of this machine are found at the ports of the first
// participants.
constexpr const char* kThisMachine =
    "<General><Interfaces><NetworkInterface name='lo' "
    "multicast='false'/></Interfaces><AllowMulticast>false</AllowMulticast>"
    "</General><Discovery><ParticipantIndex>auto</ParticipantIndex><MaxAutoParticipantIndex>100</"
    "MaxAutoParticipantIndex>"
    "<Peers><Peer Address='127.0.0.1'/></Peers></Discovery>";

struct DeleteQos {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};
using Qos = std::unique_ptr<dds_qos_t, DeleteQos>;

// A thousand samples per second of a few hundred bytes wait for nobody: the newest replace the oldest.
constexpr int kStreamDepth = 10;

Qos qosOf(Delivery delivery, bool reliable) {
  Qos qos(dds_create_qos());
  dds_qset_reliability(qos.get(), reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT, 0);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, delivery == Delivery::state ? 1 : kStreamDepth);
  return qos;
}

Entity domainOf(std::uint32_t domain, bool network) {
  const bool configured =
      network || std::getenv("CYCLONEDDS_URI") != nullptr;  // NOLINT(concurrency-mt-unsafe)
  if (configured) return {DDS_CYCLONEDDS_HANDLE, "DDS"};
  return {dds_create_domain(domain, kThisMachine), "a DDS domain on the loopback interface"};
}

}  // namespace

Entity::Entity(dds_entity_t handle, const std::string& what) : handle_(handle) {
  if (handle < 0) throw std::runtime_error("cannot create " + what + ": " + dds_strretcode(-handle));
}

Entity::~Entity() {
  if (handle_ > 0) dds_delete(handle_);
}

Participant::Participant(std::uint32_t domain, bool network, std::string nameSpace)
    : nameSpace_(std::move(nameSpace)),
      domain_(domainOf(domain, network)),
      participant_(dds_create_participant(domain, nullptr, nullptr),
                   "a participant in DDS domain " + std::to_string(domain)) {}

std::string Participant::fullName(const std::string& name) const {
  return name.starts_with('/') ? name : nameSpace_ + '/' + name;
}

Entity Participant::topic(const dds_topic_descriptor_t& type, const std::string& name) const {
  return {dds_create_topic(participant_.handle(), &type, ("rt" + fullName(name)).c_str(), nullptr, nullptr),
          "the topic " + fullName(name)};
}

Entity Participant::writer(const dds_topic_descriptor_t& type, const std::string& name,
                           Delivery delivery) const {
  const Qos qos = qosOf(delivery, true);
  if (delivery == Delivery::state) dds_qset_durability(qos.get(), DDS_DURABILITY_TRANSIENT_LOCAL);
  return {dds_create_writer(participant_.handle(), topic(type, name).handle(), qos.get(), nullptr),
          "a writer of " + fullName(name)};
}

Entity Participant::reader(const dds_topic_descriptor_t& type, const std::string& name,
                           Delivery delivery) const {
  return {dds_create_reader(participant_.handle(), topic(type, name).handle(),
                            qosOf(delivery, delivery == Delivery::state).get(), nullptr),
          "a reader of " + fullName(name)};
}

}  // namespace hapticd::apps::ros2
