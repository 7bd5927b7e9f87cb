#pragma once
// Writing state to bytes and reading it back: one list of members serves both ways.

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

namespace calib::dem {

/// Types that go to an archive as they lie in memory, unless they have a Visit() of their own and
/// are no elements of a vector.
template <class T>
inline constexpr bool kPlain = std::is_trivially_copyable_v<T>;

/// Appends members to bytes(). Not thread-safe. Plain numbers and structs as they lie in memory
/// (little-endian IEEE machines only), vectors and strings with their length in front, other types
/// by their Visit().
class SaveArchive {
 public:
  template <class... T>
  void operator()(T&... members) {
    (Put(members), ...);
  }
  [[nodiscard]] std::string& bytes() { return bytes_; }

 private:
  template <class T>
  void Put(T& value) {
    if constexpr (requires { value.Visit(*this); }) {
      value.Visit(*this);
    } else {
      static_assert(kPlain<T>);
      bytes_.append(reinterpret_cast<const char*>(&value), sizeof value);
    }
  }
  template <class T>
  void Put(std::vector<T>& values) {
    std::uint64_t size = values.size();
    Put(size);
    if constexpr (kPlain<T>) {
      bytes_.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
    } else {
      for (T& value : values) {
        Put(value);
      }
    }
  }
  void Put(std::string& text) {
    std::uint64_t size = text.size();
    Put(size);
    bytes_ += text;
  }

  std::string bytes_;
};

/// Reads what SaveArchive wrote. ok() is false once the bytes have not sufficed; members are then
/// undefined. Not thread-safe; the bytes have to outlive it.
class LoadArchive {
 public:
  explicit LoadArchive(const std::string& bytes) : bytes_(bytes) {}

  template <class... T>
  void operator()(T&... members) {
    (Get(members), ...);
  }
  /// Whether the bytes held all members that were read, and nothing more.
  [[nodiscard]] bool complete() const { return ok_ && at_ == bytes_.size(); }
  /// Whether the bytes held all members that were read.
  [[nodiscard]] bool ok() const { return ok_; }

 private:
  template <class T>
  void Get(T& value) {
    if constexpr (requires { value.Visit(*this); }) {
      value.Visit(*this);
    } else {
      static_assert(kPlain<T>);
      Take(&value, sizeof value);
    }
  }
  template <class T>
  void Get(std::vector<T>& values) {
    const std::uint64_t size = Size(kPlain<T> ? sizeof(T) : 1);
    values.assign(size, T{});
    if constexpr (kPlain<T>) {
      Take(values.data(), values.size() * sizeof(T));
    } else {
      for (T& value : values) {
        Get(value);
      }
    }
  }
  void Get(std::string& text) {
    text.assign(Size(1), '\0');
    Take(text.data(), text.size());
  }
  /// Reads a number of elements; sets ok_ to false where the remaining bytes cannot hold as many
  /// elements of at least `least` bytes each.
  std::uint64_t Size(std::size_t least) {
    std::uint64_t size = 0;
    Get(size);
    ok_ = ok_ && size <= (bytes_.size() - at_) / least;
    return ok_ ? size : 0;
  }
  void Take(void* to, std::size_t size) {
    ok_ = ok_ && size <= bytes_.size() - at_;
    if (ok_ && size > 0) {  // an empty vector has no place to copy to
      std::memcpy(to, bytes_.data() + at_, size);
      at_ += size;
    }
  }

  const std::string& bytes_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace calib::dem
