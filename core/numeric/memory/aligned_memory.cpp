// SPDX-License-Identifier: BSD-3-Clause
#include "memory/aligned_memory.hpp"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <limits>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include <boost/interprocess/mem_algo/rbtree_best_fit.hpp>
#include <boost/interprocess/sync/mutex_family.hpp>

#include "cairn/memory/growing_array.hpp"
#include "cairn/memory/small_pages.hpp"

namespace cairn::memory {
namespace {

constexpr std::size_t kCacheLine = 64;
constexpr std::size_t kHugePage = std::size_t{1} << 21;
#if defined(CAIRN_SANITIZED)
// Every byte beyond an array is noticed.
constexpr std::size_t kSmall = 0, kShared = kHugePage, kSharedEnd = kHugePage;
constexpr std::size_t kMapped = std::numeric_limits<std::size_t>::max();
#else
// Below, the C library's own alignment takes several times as long as what a cache line costs.
constexpr std::size_t kSmall = 4096;
// Arrays of these sizes share huge pages. Smaller ones mostly find room in pages that were touched
// before; larger ones leave room in a page that others rarely fill.
constexpr std::size_t kShared = 16384, kSharedEnd = kHugePage / 4;
// Arrays that grow are mappings of their own from this size on.
constexpr std::size_t kMapped = kSharedEnd;
#endif
// What is left of a large array after its whole huge pages gets one too, if it is so much.
constexpr std::size_t kWorthHugePage = kHugePage / 4 * 3;

/// How many `SmallPages` this thread has.
thread_local int small_pages = 0;

/// Whether pages are to be huge. That is advice, so a refusal is no error.
int advice_on_pages() { return small_pages > 0 ? MADV_NOHUGEPAGE : MADV_HUGEPAGE; }

/// Memory of whole huge pages, or of as many small ones.
void* allocate_pages(std::size_t bytes) {
  void* memory = ::operator new (bytes, std::align_val_t{kHugePage});
  ::madvise(memory, bytes / kHugePage * kHugePage, advice_on_pages());
  return memory;
}
void release_pages(void* memory) noexcept {
  ::operator delete (memory, std::align_val_t{kHugePage});
}

/// Rounded up where a huge page more is worth it.
std::size_t in_pages(std::size_t bytes) {
  const std::size_t rest = bytes % kHugePage;
  return rest >= kWorthHugePage ? bytes - rest + kHugePage : bytes;
}

/// Huge pages that arrays share, each with an allocator of Boost's at its beginning, and stretches
/// of small pages of the same size. What nobody uses any more goes back to the system, except for
/// the last of each kind.
class SharedPages {
 public:
  void* allocate(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    Kind& wanted = small_pages > 0 ? small_ : huge_;
    // What has been touched, of either kind, costs nothing.
    for (const Kind* kind : {&wanted, &wanted == &small_ ? &huge_ : &small_}) {
      for (Page* page : kind->pages) {
        if (void* memory = page->allocate(bytes)) return memory;
      }
    }
    wanted.pages.reserve(wanted.pages.size() + 1);
    void* memory = allocate_pages(kHugePage);
    wanted.pages.push_back(::new (memory) Page(kHugePage, 0));
    return wanted.pages.back()->allocate(bytes);
  }
  void release(void* memory) noexcept {
    const std::lock_guard lock(mutex_);
    Page* page = page_of(memory);
    page->deallocate(memory);
    if (!page->all_memory_deallocated()) return;
    Kind& kind = std::ranges::find(small_.pages, page) != small_.pages.end() ? small_ : huge_;
    if (kind.spare && kind.spare != page && kind.spare->all_memory_deallocated()) {
      std::erase(kind.pages, page);
      page->~Page();
      return release_pages(page);
    }
    kind.spare = page;
  }

 private:
  using Page = boost::interprocess::rbtree_best_fit<boost::interprocess::null_mutex_family, void*,
                                                    kCacheLine>;
  struct Kind {
    std::vector<Page*> pages;
    Page* spare = nullptr;  // one that was empty when last seen
  };
  static Page* page_of(void* memory) {
    const auto address = reinterpret_cast<std::uintptr_t>(memory);
    return reinterpret_cast<Page*>(address / kHugePage * kHugePage);
  }

  std::mutex mutex_;
  Kind huge_, small_;
};

SharedPages& shared_pages() {
  static auto* pages =
      new SharedPages();  // never destroyed: arrays of static objects may outlive it
  return *pages;
}

/// Whole pages of the system, from the beginning of a huge page on, so that all that can be huge
/// may be.
void* map(std::size_t bytes, int advice) {
  const std::size_t more = bytes + kHugePage;
  void* const mapped =
      ::mmap(nullptr, more, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (mapped == MAP_FAILED) throw std::bad_alloc();
  auto* const first = static_cast<unsigned char*>(mapped);
  const std::size_t before =
      (kHugePage - reinterpret_cast<std::uintptr_t>(first) % kHugePage) % kHugePage;
  if (before > 0) ::munmap(first, before);
  unsigned char* const memory = first + before;
  ::munmap(memory + bytes, more - bytes - before);
  ::madvise(memory, bytes, advice);
  return memory;
}

/// What a mapping for so many bytes takes.
std::size_t mapped_size(std::size_t bytes) {
  static const auto page = static_cast<std::size_t>(::sysconf(_SC_PAGESIZE));
  return (in_pages(bytes) + page - 1) / page * page;
}

/// `old`, a mapping of its own or not, as room for `bytes`.
Room moved_to_room(const Room& old, std::size_t used, std::size_t bytes) {
  // The first touch of a huge page clears 2 MB at once: while an array grows each page is cleared
  // when it is needed. The advice is for all of a mapping, since mremap takes only what has one.
  if (old.bytes >= kMapped) {
    void* larger = ::mremap(old.begin, mapped_size(old.bytes), mapped_size(bytes), MREMAP_MAYMOVE);
    if (larger == MAP_FAILED) throw std::bad_alloc();
    ::madvise(larger, mapped_size(bytes), MADV_NOHUGEPAGE);
    return {larger, bytes};
  }
  void* larger = bytes < kMapped ? allocate(bytes) : map(mapped_size(bytes), MADV_NOHUGEPAGE);
  if (used > 0) std::memcpy(larger, old.begin, used);
  release(old);
  return {larger, bytes};
}

}  // namespace

void* allocate(std::size_t bytes) {
  if (bytes < kSmall) {  // the byte before the array says where the memory began
    auto* const begin = static_cast<unsigned char*>(::operator new(bytes + kCacheLine));
    const auto offset = kCacheLine - reinterpret_cast<std::uintptr_t>(begin) % kCacheLine;
    begin[offset - 1] = static_cast<unsigned char>(offset);
    return begin + offset;
  }
  if (bytes < kShared) return ::operator new (bytes, std::align_val_t{kCacheLine});
  if (bytes < kSharedEnd) return shared_pages().allocate(bytes);
  return allocate_pages(in_pages(bytes));
}

void release(void* memory, std::size_t bytes) noexcept {
  if (bytes < kSmall) {
    auto* const array = static_cast<unsigned char*>(memory);
    return ::operator delete(array - array[-1]);
  }
  if (bytes < kShared) return ::operator delete (memory, std::align_val_t{kCacheLine});
  if (bytes < kSharedEnd) return shared_pages().release(memory);
  release_pages(memory);
}

SmallPages::SmallPages() noexcept { ++small_pages; }
SmallPages::~SmallPages() { --small_pages; }

Room make_room(std::size_t bytes) {
  return {bytes < kMapped ? allocate(bytes) : map(mapped_size(bytes), advice_on_pages()), bytes};
}

Room enlarge(const Room& old, std::size_t used, std::size_t needed) {
  constexpr std::size_t kMost = std::numeric_limits<std::ptrdiff_t>::max() - 2 * kHugePage;
  if (needed > kMost) throw std::bad_alloc();
  const std::size_t twice = std::min(2 * std::max(old.bytes, kCacheLine), kMost);
  if (needed >= twice) return moved_to_room(old, used, needed);
  for (const std::size_t bytes : {twice, needed + (twice - needed) / 8}) {
    try {
      return moved_to_room(old, used, bytes);
    } catch (const std::bad_alloc&) {
      continue;  // less may do
    }
  }
  return moved_to_room(old, used, needed);
}

void release(const Room& room) noexcept {
  if (room.bytes >= kMapped) {
    ::munmap(room.begin, mapped_size(room.bytes));
  } else if (room.begin) {
    release(room.begin, room.bytes);
  }
}

}  // namespace cairn::memory
