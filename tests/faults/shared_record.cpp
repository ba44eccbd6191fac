// SPDX-License-Identifier: BSD-3-Clause
#include "shared_record.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include "process.hpp"

namespace cairn::faults {

SharedRecord::SharedRecord(const std::filesystem::path& file) {
  const Descriptor opened(file, O_RDWR | O_CREAT | O_TRUNC);
  const bool sized = ::ftruncate(opened.number(), sizeof(FaultRecord)) == 0;
  void* const memory = sized ? ::mmap(nullptr, sizeof(FaultRecord), PROT_READ | PROT_WRITE,
                                      MAP_SHARED, opened.number(), 0)
                             : MAP_FAILED;
  if (memory == MAP_FAILED) throw std::runtime_error(file.string() + ": " + std::strerror(errno));
  record_ = static_cast<FaultRecord*>(memory);  // of zeros
}

SharedRecord::~SharedRecord() { ::munmap(record_, sizeof(FaultRecord)); }

}  // namespace cairn::faults
