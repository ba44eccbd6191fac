// SPDX-License-Identifier: BSD-3-Clause
// What the driver has to notice: ends by a signal where memory runs out, with the wrong exit code
// where an output fails, leaves half a file and a temporary one, and forgets a second output.
#include <fcntl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

namespace {

bool write_half_of(const char* name, const char* text) {
  const int file = ::open(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
  const bool written = file >= 0 && ::write(file, text, 4) == 4 && ::write(file, text + 4, 4) == 4;
  if (file >= 0) ::close(file);
  return written;
}

}  // namespace

int main() {
  const auto numbers = std::vector<int>(100, 1);  // no handler: std::terminate
  void* memory = std::malloc(numbers.size());
  if (!memory) return 0;  // as if all was written
  std::free(memory);
  if (!write_half_of("temporary.txt", "12345678")) return 1;
  ::unlink("temporary.txt");
  if (!write_half_of("result.txt", "12345678")) {
    std::fputs("cairn: result.txt: cannot be written\n", stderr);
    return 3;
  }
  return write_half_of("second.txt", "12345678") ? 0 : 3;
}
