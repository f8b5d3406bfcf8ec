#include "server/scene/scene_host.h"

namespace hapticd::server {

void SceneHost::start(SceneThread::Callbacks callbacks) {
  thread_ = std::make_unique<SceneThread>(std::move(devices_), std::move(callbacks));
  thread_->start();
}

void SceneHost::stop() {
  if (thread_) thread_->stop();
}

CommandDecoder::Outcome SceneHost::take(scene::ClientId client, const wire::MessageReceived& message,
                               std::string& error) {
  const CommandDecoder::Outcome outcome = decoder_.take(client, message, error);
  if (outcome == CommandDecoder::Outcome::taken) commanders_.insert(client);
  return outcome;
}

bool SceneHost::flush() {
  if (!thread_) return true;
  if (!decoder_.empty()) {
    const std::size_t bytes = decoder_.bytes();
    thread_->enqueue(decoder_.release(), bytes);
  }
  return !thread_->full();
}

void SceneHost::play(scene::ClientId client, const scene::SceneCommand* command) {
  std::vector<SceneTask> tasks;
  if (command != nullptr) {
    tasks.push_back({client, *command});
  } else {
    tasks.push_back({client, ClientGone{}});
  }
  thread_->enqueue(std::move(tasks), sizeof(SceneTask));
}

void SceneHost::clientGone(scene::ClientId client) {
  decoder_.add({client, ClientGone{}});
  const bool lastToCommand = commanders_.erase(client) == 1 && commanders_.empty();
  if (lastToCommand && onDisconnect_ == SceneOnDisconnect::clear) {
    decoder_.add({client, scene::SceneCommand{scene::ResetScene{}}});
  }
  flush();
}

void SceneHost::describe(std::function<void(std::shared_ptr<const scene::SceneDescription>)> answer) {
  std::vector<SceneTask> question;
  question.push_back({0, DescribeScene{std::move(answer)}});
  if (thread_) thread_->enqueue(std::move(question), 0);
}

}  // namespace hapticd::server
