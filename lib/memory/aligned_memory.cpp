// SPDX-License-Identifier: BSD-3-Clause
#include "memory/aligned_memory.hpp"

#include <sys/mman.h>

#include <cstdint>
#include <cstring>
#include <limits>
#include <mutex>
#include <new>
#include <utility>
#include <vector>

#include <boost/interprocess/mem_algo/rbtree_best_fit.hpp>
#include <boost/interprocess/sync/mutex_family.hpp>

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

/// Memory of whole huge pages. That they are huge is advice, so a refusal is no error.
void* allocate_pages(std::size_t bytes) {
  void* memory = ::operator new (bytes, std::align_val_t{kHugePage});
  ::madvise(memory, bytes / kHugePage * kHugePage, MADV_HUGEPAGE);
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

/// Huge pages that arrays share, each with an allocator of Boost's at its beginning. A page that
/// nobody uses any more goes back to the system, except for the last of them.
class SharedPages {
 public:
  void* allocate(std::size_t bytes) {
    const std::lock_guard lock(mutex_);
    for (Page* page : pages_) {
      if (void* memory = page->allocate(bytes)) return memory;
    }
    pages_.reserve(pages_.size() + 1);
    void* memory = allocate_pages(kHugePage);
    pages_.push_back(::new (memory) Page(kHugePage, 0));
    return pages_.back()->allocate(bytes);
  }
  void release(void* memory) noexcept {
    const std::lock_guard lock(mutex_);
    Page* page = page_of(memory);
    page->deallocate(memory);
    if (!page->all_memory_deallocated()) return;
    if (spare_ && spare_ != page && spare_->all_memory_deallocated()) {
      std::erase(pages_, page);
      page->~Page();
      return release_pages(page);
    }
    spare_ = page;
  }

 private:
  using Page = boost::interprocess::rbtree_best_fit<boost::interprocess::null_mutex_family, void*,
                                                    kCacheLine>;
  static Page* page_of(void* memory) {
    const auto address = reinterpret_cast<std::uintptr_t>(memory);
    return reinterpret_cast<Page*>(address / kHugePage * kHugePage);
  }

  std::mutex mutex_;
  std::vector<Page*> pages_;
  Page* spare_ = nullptr;  // one that was empty when last seen
};

SharedPages& shared_pages() {
  static auto* pages =
      new SharedPages();  // never destroyed: arrays of static objects may outlive it
  return *pages;
}

void* map(std::size_t bytes, int advice) {
  void* memory = ::mmap(nullptr, bytes, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  if (memory == MAP_FAILED) throw std::bad_alloc();
  ::madvise(memory, bytes, advice);
  return memory;
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

void* allocate_growing(std::size_t bytes) {
  return bytes < kMapped ? allocate(bytes) : map(bytes, MADV_HUGEPAGE);
}

void* grow(void* memory, std::size_t used, std::size_t bytes, std::size_t more) {
  // The first touch of a huge page clears 2 MB at once: here each page is cleared when it is
  // needed. The advice is for all of a mapping, since mremap takes only what has one.
  if (bytes >= kMapped) {
    void* larger = ::mremap(memory, bytes, more, MREMAP_MAYMOVE);
    if (larger == MAP_FAILED) throw std::bad_alloc();
    ::madvise(larger, more, MADV_NOHUGEPAGE);
    return larger;
  }
  void* larger = more < kMapped ? allocate(more) : map(more, MADV_NOHUGEPAGE);
  if (used > 0) std::memcpy(larger, memory, used);
  if (memory) release(memory, bytes);
  return larger;
}

void release_growing(void* memory, std::size_t bytes) noexcept {
  if (bytes < kMapped) return release(memory, bytes);
  ::munmap(memory, bytes);
}

}  // namespace cairn::memory
