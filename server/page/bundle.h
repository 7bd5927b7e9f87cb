#pragma once
// The files of the page as they were compiled in (web/).

#include <span>
#include <string_view>

namespace calib::page {

struct BundledFile {
  std::string_view name;     ///< "index.html", "page.js"
  std::string_view content;  ///< bytes
};

/// All of them; none where the build has no page (CALIB_PAGE=OFF).
std::span<const BundledFile> Bundle();

}  // namespace calib::page
