// What this program is: version, sources, compiler, features.
#pragma once

#include <string>

namespace hapticd::apps {

/// The output of `hapticd --version`; the first line is "hapticd VERSION (COMMIT)".
std::string versionText();

}  // namespace hapticd::apps
