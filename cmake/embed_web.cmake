# cmake -DDIST=folder -DOUT=file.cpp -P embed_web.cmake: a source file that holds every file of the folder.
file(GLOB_RECURSE files RELATIVE ${DIST} ${DIST}/*)
list(SORT files)
set(data "")
set(table "")
set(count 0)
foreach(file IN LISTS files)
  file(SHA256 ${DIST}/${file} hash)  # another content makes another source, which is compiled again
  string(APPEND data "// ${hash}\n"
    "asm(\".section .rodata\\n.balign 16\\nhapticd_web_${count}:\\n.incbin \\\"${DIST}/${file}\\\"\\n\"\n"
    "    \"hapticd_web_${count}_end:\\n.previous\\n\");\n"
    "extern \"C\" const std::byte hapticd_web_${count}[];\n"
    "extern \"C\" const std::byte hapticd_web_${count}_end[];\n")
  string(APPEND table "      {\"${file}\", {hapticd_web_${count}, hapticd_web_${count}_end}},\n")
  math(EXPR count "${count} + 1")
endforeach()
string(CONCAT text "// Made by cmake/embed_web.cmake.\n#include <vector>\n\n#include \"server/web/web_assets.h\"\n\n${data}\n"
  "namespace hapticd::server {\n\nstd::span<const WebAsset> webAssets() {\n"
  "  static const std::vector<WebAsset> kAssets{\n${table}  };\n  return kAssets;\n}\n\n}  // namespace hapticd::server\n")
set(before "")
if(EXISTS ${OUT})
  file(READ ${OUT} before)
endif()
if(NOT before STREQUAL text)
  file(WRITE ${OUT} "${text}")
endif()
