#include "version.h"

#include "device/drivers/drivers.h"
#include "hapticd_commit.h"
#include "record/recording.h"
#include "server/web/web_assets.h"
#include "wire/cookie.h"

namespace hapticd::apps {
namespace {

#if defined(__clang__)
constexpr const char* kCompiler = "clang " __clang_version__;
#else
constexpr const char* kCompiler = "g++ " __VERSION__;
#endif

}  // namespace

std::string versionText() {
  const bool viewer = !server::webAssets().empty();
  return "hapticd " HAPTICD_VERSION " (" HAPTICD_COMMIT ")\n" + std::string("compiler  ") + kCompiler +
         ", " HAPTICD_BUILD "\n" + "viewer    " + (viewer ? "yes" : "no") + "\n" + "drivers   " +
         device::driverNames() + "\n" + "formats   recordings 1 to " +
         std::to_string(record::kFormatVersion) + ", wire " + std::string(wire::kVersionText);
}

}  // namespace hapticd::apps
