// SPDX-License-Identifier: BSD-3-Clause
// A library for LD_PRELOAD: counts the allocations, the threads and the calls on outputs of a
// program from the beginning of main() on, makes one of them fail (fault_record.hpp), and holds the
// clock, so that two runs write the same bytes, or makes it wrong.
//
// An output is a regular file that is open for writing; standard error is none. What goes through
// streams of the C library does not come by here, since that calls nothing that could be replaced.
// Files are not synchronised to the disk: no power fails here.

#ifndef _GNU_SOURCE
#define _GNU_SOURCE
#endif
#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <string_view>

#include "fault_record.hpp"

#define CAIRN_INJECTED extern "C" __attribute__((visibility("default")))

// glibc's own, which need no look-up that would itself allocate.
extern "C" void* __libc_malloc(std::size_t bytes);
extern "C" void* __libc_calloc(std::size_t count, std::size_t bytes);
extern "C" void* __libc_realloc(void* memory, std::size_t bytes);
extern "C" void* __libc_memalign(std::size_t alignment, std::size_t bytes);

namespace cairn::faults {
namespace {

enum class Kind { none, enospc, eio, eintr, cut_short, full, kill };

/// What is asked for, and where it is counted.
struct Plan {
  FaultRecord* record = nullptr;
  std::uint64_t allocation = 0, memory = 0, thread = 0, output = 0;
  Kind kind = Kind::none;
  bool clock_runs = false;
  bool armed = false;
};
Plan plan;

std::uint64_t number_of(const char* variable) {
  const char* text = std::getenv(variable);
  return text ? std::strtoull(text, nullptr, 10) : 0;
}

Kind kind_of(const char* text) {
  const std::string_view name = text ? text : "";
  if (name == "ENOSPC") return Kind::enospc;
  if (name == "EIO") return Kind::eio;
  if (name == "EINTR") return Kind::eintr;
  if (name == "SHORT") return Kind::cut_short;
  if (name == "KILL") return Kind::kill;
  return name == "FULL" ? Kind::full : Kind::none;
}

/// The real function of that name, looked up once, before main().
template <class Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

int raw_open(const char* path, int flags, mode_t mode) {
  return static_cast<int>(::syscall(SYS_openat, AT_FDCWD, path, flags, mode));
}

FaultRecord* map_record(const char* path) {
  if (!path) return nullptr;
  const int descriptor = raw_open(path, O_RDWR | O_CLOEXEC, 0);
  if (descriptor < 0) return nullptr;
  void* memory =
      ::mmap(nullptr, sizeof(FaultRecord), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  ::syscall(SYS_close, descriptor);
  return memory == MAP_FAILED ? nullptr : static_cast<FaultRecord*>(memory);
}

// Allocations -------------------------------------------------------------------------------------

}  // namespace

/// Called where an allocation is to fail: a place for a debugger's breakpoint.
extern "C" __attribute__((visibility("default"), noinline)) void cairn_fault_comes() {
  ++plan.record->failed;
}

namespace {

/// Whether this allocation fails.
bool allocation_fails() {
  if (!plan.armed) return false;
  const std::uint64_t number = ++plan.record->allocations;
  const bool fails = number == plan.allocation || (plan.memory > 0 && number >= plan.memory);
  if (!fails) return false;
  cairn_fault_comes();
  errno = ENOMEM;
  return true;
}

// Outputs -----------------------------------------------------------------------------------------

bool is_output(int descriptor) {
  if (!plan.armed || descriptor == STDERR_FILENO) return false;
  struct stat status {};
  if (::fstat(descriptor, &status) != 0 || !S_ISREG(status.st_mode)) return false;
  return (::fcntl(descriptor, F_GETFL) & O_ACCMODE) != O_RDONLY;
}

/// What a full disk refuses.
bool needs_room(Call call) {
  return call == Call::open || call == Call::write || call == Call::sync;
}

[[noreturn]] void kill_this_process() {
  for (;;) ::syscall(SYS_kill, ::syscall(SYS_getpid), SIGKILL);
}

/// Counts a call, and lists it with the path that `write_path(buffer, size)` gives.
template <class WritePath>
bool counted_call_fails(Call call, const WritePath& write_path) {
  FaultRecord& record = *plan.record;
  const std::uint64_t number = ++record.outputs;
  const bool planned = plan.kind == Kind::full && plan.output > 0 && number > plan.output;
  const bool full = needs_room(call) && (planned || record.disk_full > 0);
  const bool fails = number == plan.output || full;
  if (fails) ++record.failed;
  if (number <= FaultRecord::kMostCalls) {
    OutputCall& listed = record.calls[number - 1];
    listed.call = call;
    listed.failed = fails ? 1 : 0;
    write_path(listed.path.data(), listed.path.size() - 1);
  }
  if (fails && plan.kind == Kind::kill && call != Call::write) kill_this_process();
  return fails;
}

bool call_fails(Call call, int descriptor) {
  if (!is_output(descriptor)) return false;
  return counted_call_fails(call, [&](char* buffer, std::size_t size) {
    char link[40];
    std::snprintf(link, sizeof link, "/proc/self/fd/%d", descriptor);
    const ssize_t length = ::readlink(link, buffer, size);
    buffer[length < 0 ? 0 : length] = '\0';
  });
}

bool call_fails(Call call, const char* path) {
  if (!plan.armed) return false;
  return counted_call_fails(
      call, [&](char* buffer, std::size_t size) { std::strncpy(buffer, path, size); });
}

/// A regular file, or one that is not there yet, that is to be opened for writing.
bool opens_output(const char* path, int flags) {
  if (!plan.armed || (flags & O_ACCMODE) == O_RDONLY || (flags & O_PATH) == O_PATH) return false;
  struct stat status {};
  if (::stat(path, &status) != 0) return (flags & O_CREAT) != 0;
  return S_ISREG(status.st_mode);
}

/// -1, with the error of the plan.
int fail() {
  errno = plan.kind == Kind::eio ? EIO : plan.kind == Kind::eintr ? EINTR : ENOSPC;
  return -1;
}

bool at_the_planned_call() { return plan.record->outputs == plan.output; }

/// Whether half of this write succeeds, as where a disk becomes full.
bool half_is_written() {
  if (plan.record->disk_full == 2) {
    plan.record->disk_full = 1;
    return true;
  }
  const bool half =
      plan.kind == Kind::cut_short || plan.kind == Kind::full || plan.kind == Kind::kill;
  return half && at_the_planned_call();
}

ssize_t raw_write(int descriptor, const void* bytes, std::size_t count) {
  return ::syscall(SYS_write, descriptor, bytes, count);
}

/// A write that fails: by the plan in whole, or after half of its bytes.
ssize_t write_badly(int descriptor, const void* bytes, std::size_t count) {
  const ssize_t half = half_is_written() && count > 1 ? raw_write(descriptor, bytes, count / 2) : 0;
  if (plan.kind == Kind::kill) kill_this_process();
  if (half != 0) return half;
  if (plan.kind == Kind::cut_short) return raw_write(descriptor, bytes, count);
  return fail();
}

ssize_t write_through(int descriptor, const void* bytes, std::size_t count) {
  return call_fails(Call::write, descriptor) ? write_badly(descriptor, bytes, count)
                                             : raw_write(descriptor, bytes, count);
}

int open_through(int folder, const char* path, int flags, mode_t mode) {
  if (opens_output(path, flags) && call_fails(Call::open, path)) return fail();
  return static_cast<int>(::syscall(SYS_openat, folder, path, flags, mode));
}

mode_t mode_of(int flags, std::va_list arguments) {
  const bool given = (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE;
  return given ? va_arg(arguments, mode_t) : 0;
}

// Start -------------------------------------------------------------------------------------------

using Main = int(int, char**, char**);
Main* real_main = nullptr;

int counted_main(int argc, char** argv, char** environment) {
  plan.record = map_record(std::getenv(kRecordVariable));
  if (plan.record) {
    plan.allocation = number_of(kAllocationVariable);
    plan.memory = number_of(kMemoryVariable);
    plan.thread = number_of(kThreadVariable);
    plan.output = number_of(kOutputVariable);
    plan.kind = kind_of(std::getenv(kKindVariable));
    plan.clock_runs = std::getenv(kClockVariable) != nullptr;
    FaultRecord& record = *plan.record;
    record.allocations = record.threads = record.outputs = record.failed = 0;  // of a run before
    record.started = 1;
    ::unsetenv(kRecordVariable);  // of a program that this one starts nothing is counted
    plan.armed = true;
  }
  return real_main(argc, argv, environment);
}

}  // namespace
}  // namespace cairn::faults

using namespace cairn::faults;

CAIRN_INJECTED int __libc_start_main(Main* entry, int argc, char** argv, void (*init)(),
                                     void (*finish)(), void (*finish_loader)(), void* stack_end) {
  using Start = int(Main*, int, char**, void (*)(), void (*)(), void (*)(), void*);
  real_main = entry;
  return real<Start>("__libc_start_main")(counted_main, argc, argv, init, finish, finish_loader,
                                          stack_end);
}

// Memory. free() takes what these return as it is.

CAIRN_INJECTED void* malloc(std::size_t bytes) {
  return allocation_fails() ? nullptr : __libc_malloc(bytes);
}

CAIRN_INJECTED void* calloc(std::size_t count, std::size_t bytes) {
  return allocation_fails() ? nullptr : __libc_calloc(count, bytes);
}

CAIRN_INJECTED void* realloc(void* memory, std::size_t bytes) {
  return allocation_fails() ? nullptr : __libc_realloc(memory, bytes);
}

CAIRN_INJECTED void* memalign(std::size_t alignment, std::size_t bytes) {
  return allocation_fails() ? nullptr : __libc_memalign(alignment, bytes);
}

CAIRN_INJECTED void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return allocation_fails() ? nullptr : __libc_memalign(alignment, bytes);
}

CAIRN_INJECTED int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  if (allocation_fails()) return ENOMEM;
  void* found = __libc_memalign(alignment, bytes);
  if (!found) return ENOMEM;
  *memory = found;
  return 0;
}

// Threads.

CAIRN_INJECTED int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                                  void* (*start)(void*), void* argument) {
  using Create = int(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*);
  static Create* const create = real<Create>("pthread_create");
  if (plan.armed) {
    const std::uint64_t number = ++plan.record->threads;
    if (plan.thread > 0 && number >= plan.thread) {
      ++plan.record->failed;
      return EAGAIN;
    }
  }
  return create(thread, attributes, start, argument);
}

// Files.

CAIRN_INJECTED int open(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_through(AT_FDCWD, path, flags, mode);
}

CAIRN_INJECTED int open64(const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_through(AT_FDCWD, path, flags, mode);
}

CAIRN_INJECTED int openat(int folder, const char* path, int flags, ...) {
  std::va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  return open_through(folder, path, flags, mode);
}

CAIRN_INJECTED int creat(const char* path, mode_t mode) {
  return open_through(AT_FDCWD, path, O_CREAT | O_WRONLY | O_TRUNC, mode);
}

// Of streams only the opening can fail here.
CAIRN_INJECTED std::FILE* fopen(const char* path, const char* mode) {
  using Open = std::FILE*(const char*, const char*);
  static Open* const open_stream = real<Open>("fopen");
  const bool writes = std::strpbrk(mode, "wa+") != nullptr;
  if (writes && opens_output(path, O_WRONLY | O_CREAT) && call_fails(Call::open, path)) {
    fail();
    return nullptr;
  }
  return open_stream(path, mode);
}

CAIRN_INJECTED ssize_t write(int descriptor, const void* bytes, std::size_t count) {
  return write_through(descriptor, bytes, count);
}

CAIRN_INJECTED ssize_t pwrite(int descriptor, const void* bytes, std::size_t count, off_t offset) {
  if (!call_fails(Call::write, descriptor))
    return ::syscall(SYS_pwrite64, descriptor, bytes, count, offset);
  const ssize_t half = half_is_written() && count > 1
                           ? ::syscall(SYS_pwrite64, descriptor, bytes, count / 2, offset)
                           : 0;
  if (plan.kind == Kind::kill) kill_this_process();
  return half != 0 ? half : fail();
}

// Where it fails, at most the first of the parts is written.
CAIRN_INJECTED ssize_t writev(int descriptor, const iovec* parts, int count) {
  if (count > 0 && call_fails(Call::write, descriptor))
    return write_badly(descriptor, parts[0].iov_base, parts[0].iov_len);
  return ::syscall(SYS_writev, descriptor, parts, count);
}

CAIRN_INJECTED int fsync(int descriptor) { return call_fails(Call::sync, descriptor) ? fail() : 0; }

CAIRN_INJECTED int fdatasync(int descriptor) {
  return call_fails(Call::sync, descriptor) ? fail() : 0;
}

CAIRN_INJECTED int ftruncate(int descriptor, off_t size) noexcept {
  if (call_fails(Call::truncate, descriptor)) return fail();
  return static_cast<int>(::syscall(SYS_ftruncate, descriptor, size));
}

CAIRN_INJECTED int rename(const char* from, const char* to) noexcept {
  if (call_fails(Call::rename, to)) return fail();
  return static_cast<int>(::syscall(SYS_renameat2, AT_FDCWD, from, AT_FDCWD, to, 0));
}

/// The descriptor is closed also where that fails, as Linux does it.
CAIRN_INJECTED int close(int descriptor) {
  const bool fails = call_fails(Call::close, descriptor);
  const int closed = static_cast<int>(::syscall(SYS_close, descriptor));
  return fails ? fail() : closed;
}

// The clock. Standing still costs no loop its end: none waits for a time.

CAIRN_INJECTED int clock_gettime(clockid_t clock, timespec* time) noexcept {
  if (plan.armed && !plan.clock_runs) {
    *time = {1'000'000'000, 0};
    return 0;
  }
  const int result = static_cast<int>(::syscall(SYS_clock_gettime, clock, time));
  if (plan.armed) time->tv_sec += plan.record->clock_offset;
  return result;
}

CAIRN_INJECTED std::time_t time(std::time_t* result) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (result) *result = now.tv_sec;
  return now.tv_sec;
}
