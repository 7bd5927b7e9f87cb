#pragma once
// Early return of absl::Status and absl::StatusOr, one way for the whole tree. Knows abseil's
// status and nothing else.

#include <utility>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

/// Returns the status of `expression` from the enclosing function unless it is OK. `expression`: an
/// absl::Status, evaluated once. The function returns absl::Status or an absl::StatusOr.
#define RETURN_IF_ERROR(expression)                                     \
  do {                                                                  \
    if (absl::Status calib_status = (expression); !calib_status.ok()) { \
      return calib_status;                                              \
    }                                                                   \
  } while (false)

/// Moves the value of `expression` into `declaration`, or returns its status as above.
/// `expression`: an absl::StatusOr, evaluated once; `declaration`: `auto x`, `const Type x` or an
/// lvalue. A line has at most one, and it is a statement of its own, not the body of an `if`
/// without braces. Commas outside parentheses end an argument.
#define ASSIGN_OR_RETURN(declaration, expression) \
  CALIB_ASSIGN_OR_RETURN_(CALIB_JOIN_(calib_status_or_, __LINE__), declaration, expression)

#define CALIB_JOIN_INNER_(a, b) a##b
#define CALIB_JOIN_(a, b) CALIB_JOIN_INNER_(a, b)
#define CALIB_ASSIGN_OR_RETURN_(holder, declaration, expression) \
  auto holder = (expression);                                    \
  if (!holder.ok()) {                                            \
    return std::move(holder).status();                           \
  }                                                              \
  declaration = *std::move(holder)
