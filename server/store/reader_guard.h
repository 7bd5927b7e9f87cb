#pragma once
// What reads of a Reader share. Private to this folder.

#include "absl/status/statusor.h"
#include "server/store/connection.h"
#include "server/store/reader.h"

namespace calib::store {

template <typename F>
auto Reader::Guard(F read) -> absl::StatusOr<decltype(read())> {
  try {
    return read();
  } catch (const SQLite::Exception& error) {
    return connection_->StatusOf(error);
  }
}

}  // namespace calib::store
