#include "wire/dispatch.h"

namespace hapticd::wire::detail {

Error wrongRole(MessageKind kind, Role expected) {
  const std::string which =
      kind == kUnknownKind ? std::string("a message that is not in the table") : std::string(info(kind).name);
  return {which + " is not " + (expected == Role::control ? "a control message" : "a scene command")};
}

}  // namespace hapticd::wire::detail
