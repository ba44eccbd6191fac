// SPDX-License-Identifier: BSD-3-Clause
#include "calls.hpp"

#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "cairn/runtime/error.hpp"

namespace cairn::c {
namespace {

static_assert(static_cast<int>(ErrorCode::usage) == CAIRN_USAGE);
static_assert(static_cast<int>(ErrorCode::input) == CAIRN_INPUT);
static_assert(static_cast<int>(ErrorCode::numerical) == CAIRN_NUMERICAL);
static_assert(static_cast<int>(ErrorCode::plugin) == CAIRN_PLUGIN);

constexpr const char* kOutOfMemory = "out of memory";

thread_local std::string message;
thread_local const char* text = "";  // of `message`, or where there was no memory for that

/// Options of reading, which C does not have, as those of the program, which can convert the file.
std::string in_words_of_c(std::string words) {
  for (const auto& [member, option] :
       {std::pair("ReadOptions::skip_unknown", "cairn convert --skip-unknown"),
        std::pair("ReadOptions::repair_information", "cairn convert --repair-information"),
        std::pair("ReadOptions::unit_information", "cairn convert --unit-information"),
        std::pair("ReadOptions::skip_dangling", "cairn convert --skip-dangling")}) {
    if (const std::size_t at = words.find(member); at != std::string::npos)
      words.replace(at, std::string_view(member).size(), option);
  }
  return words;
}

cairn_code failed(cairn_code code, const char* what) noexcept {
  try {
    message = in_words_of_c(what);
    text = message.c_str();
  } catch (...) {
    text = kOutOfMemory;
  }
  return code;
}

bool is_of_resources(const std::error_code& code) {
  return code == std::errc::not_enough_memory || code == std::errc::resource_unavailable_try_again;
}

}  // namespace

cairn_code code_of_exception() noexcept {
  try {
    throw;
  } catch (const Error& error) {
    return failed(static_cast<cairn_code>(error.code()), error.what());
  } catch (const std::bad_alloc&) {
    return failed(CAIRN_NUMERICAL, kOutOfMemory);
  } catch (const std::system_error& error) {
    return failed(is_of_resources(error.code()) ? CAIRN_NUMERICAL : CAIRN_INTERNAL, error.what());
  } catch (const std::exception& error) {
    // oneTBB reports so that a thread cannot be started.
    const bool of_threads =
        std::string_view(error.what()).find("pthread_create") != std::string_view::npos;
    return failed(of_threads ? CAIRN_NUMERICAL : CAIRN_INTERNAL, error.what());
  } catch (...) {
    return failed(CAIRN_INTERNAL, "an exception that is not a std::exception");
  }
}

void refuse_null(const char* what) {
  throw Error(ErrorCode::usage, fmt::format("{} is NULL", what));
}

void refuse_size(std::size_t size, const char* what) {
  throw Error(ErrorCode::usage, fmt::format("{}: there is no array of {} elements", what, size));
}

void expect_size(std::size_t size, std::size_t expected, std::string_view what) {
  if (size == expected) return;
  throw Error(ErrorCode::usage,
              fmt::format("an array of {} for {}; expected {}", size, what, expected));
}

void copy_by_rows(std::span<const double> columns, std::size_t rows, std::span<double> out) {
  const std::size_t width = columns.size() / rows;
  for (std::size_t k = 0; k < columns.size(); ++k) out[k] = columns[k % width * rows + k / width];
}

std::string joined(const std::vector<std::string>& notes) {
  std::string lines;
  for (const std::string& note : notes) lines += note + '\n';
  return lines;
}

}  // namespace cairn::c

const char* cairn_error(void) { return cairn::c::text; }
