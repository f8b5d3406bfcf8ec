#include "server/scene/scene_host.h"

#include "base/world.h"

namespace hapticd::server {

void SceneHost::start(SceneThread::Callbacks callbacks, Post post) {
  post_ = std::move(post);
  thread_ = std::make_unique<SceneThread>(std::move(devices_), std::move(callbacks));
  thread_->start();
}

void SceneHost::stop() {
  if (thread_) thread_->stop();
}

bool SceneHost::take(scene::ClientId client, const wire::MessageReceived& message, std::string& error) {
  return decoder_.take(client, message, error) == CommandDecoder::Outcome::taken;
}

void SceneHost::flush(scene::ClientId client) {
  if (decoder_.empty() || !thread_) return;
  commandingClients_.insert(client);
  const std::size_t bytes = decoder_.bytes();
  thread_->push({client, decoder_.release(), bytes});
}

void SceneHost::whenPublished(scene::ClientId client, std::function<void()> reached) {
  flush(client);
  if (!thread_ || !thread_->queue().pending(client)) {
    reached();
    return;
  }
  push({client, WhenPublished{[post = post_, reached = std::move(reached)] { post(reached); }}});
}

void SceneHost::whenApplied(scene::ClientId client, std::function<void()> reached) {
  flush(client);
  if (!thread_ || !thread_->queue().pending(client)) {
    reached();
    return;
  }
  push({client, Inspect{[post = post_, reached = std::move(reached)](const auto&) { post(reached); }}});
}

bool SceneHost::behindReplay() const {
  return full(kReplay);
}

// The queue is fair to clients and keeps the order of each. Of what is replayed it keeps the order of all.
void SceneHost::play(scene::ClientId client, const scene::SceneCommand* command) {
  const std::size_t bytes = command != nullptr ? scene::bytesOf(*command) : 0;
  pushAs(kReplay, command != nullptr ? SceneTask{client, *command} : SceneTask{client, ClientGone{}}, bytes);
}

void SceneHost::releaseForces(scene::ClientId client) {
  if (!thread_) return;
  owners_->leave(client, base::now());
  releaseUrgently(client);
}

void SceneHost::restoreForces(scene::ClientId client) {
  if (!thread_) return;
  flush(client);
  push({client, ForcesReturn{owners_->leaves(client)}});
}

void SceneHost::peerGone(scene::ClientId client) {
  if (!thread_) return;
  owners_->leaveForGood(client, base::now());
  releaseUrgently(client);
}

void SceneHost::releaseUrgently(scene::ClientId client) {
  if (commandingClients_.count(client) != 0)
    thread_->pushUrgent({client, scene::SceneCommand{scene::ReleaseForces{}}});
}

void SceneHost::clientGone(scene::ClientId client) {
  endBatch(client);
  if (!thread_) return;
  flush(client);
  owners_->leaveForGood(client, base::now());
  push({client, ClientGone{}});
  const bool lastToCommand = commandingClients_.erase(client) == 1 && commandingClients_.empty();
  if (!lastToCommand || onDisconnect_ != SceneOnDisconnect::clear) return;
  // The next client finds the scene empty, however much the last one has still queued.
  SceneParcel clear{.client = client, .tasks = {}, .bytes = 0, .beforeOthers = true};
  clear.tasks.push_back({client, scene::SceneCommand{scene::ResetScene{}}});
  thread_->push(std::move(clear));
}

void SceneHost::describe(std::function<void(std::shared_ptr<const scene::SceneDescription>)> reply) {
  if (thread_) push({0, DescribeScene{std::move(reply)}}, 0);
}

bool SceneHost::inspect(std::function<void(const std::vector<const scene::SceneBuilder*>&)> call) {
  if (!thread_) return false;
  push({0, Inspect{std::move(call)}}, 0);
  return true;
}

void SceneHost::push(SceneTask&& task, std::size_t bytes) {
  const scene::ClientId client = task.client;
  pushAs(client, std::move(task), bytes);
}

void SceneHost::pushAs(scene::ClientId client, SceneTask&& task, std::size_t bytes) {
  SceneParcel parcel{.client = client, .tasks = {}, .bytes = bytes};
  parcel.tasks.push_back(std::move(task));
  thread_->push(std::move(parcel));
}

}  // namespace hapticd::server
