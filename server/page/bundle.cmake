# cmake -DDIST=<folder> -DBUNDLE=<file.cc> -P bundle.cmake: a source that holds the files of DIST as bytes; none where it is empty.
set(blocks "")
set(entries "")
set(count 0)
if(DIST)
  file(GLOB files RELATIVE ${DIST} ${DIST}/*)
  foreach(name IN LISTS files)
    string(APPEND blocks
      "asm(\".section .rodata\\n.global calib_page_file_${count}\\ncalib_page_file_${count}:\\n\"\n"
      "    \".incbin \\\"${DIST}/${name}\\\"\\n.global calib_page_end_${count}\\ncalib_page_end_${count}:\\n.previous\\n\");\n"
      "extern \"C\" const char calib_page_file_${count}[];\nextern \"C\" const char calib_page_end_${count}[];\n")
    string(APPEND entries
      "      {\"${name}\", {calib_page_file_${count}, static_cast<std::size_t>(calib_page_end_${count} - calib_page_file_${count})}},\n")
    math(EXPR count "${count} + 1")
  endforeach()
endif()
if(count EQUAL 0)
  set(body "  return {};\n")
else()
  set(body "  static const BundledFile files[] = {\n${entries}  };\n  return files;\n")
endif()
file(WRITE ${BUNDLE}
  "// Made by bundle.cmake.\n#include \"server/page/bundle.h\"\n\n#include <cstddef>\n\n${blocks}\nnamespace calib::page {\n\n"
  "std::span<const BundledFile> Bundle() {\n${body}}\n\n}  // namespace calib::page\n")
