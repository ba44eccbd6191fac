// SPDX-License-Identifier: BSD-3-Clause
#include "cairn/runtime/plugin_call.hpp"

#include <exception>
#include <new>

#include "cairn/runtime/error.hpp"
#include "cairn/runtime/interruption.hpp"

namespace cairn {

void rethrow_as_plugin_error(const std::string& component) {
  try {
    throw;
  } catch (const Error&) {
    throw;
  } catch (const Interruption&) {
    throw;
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& error) {
    throw Error(ErrorCode::plugin, component + " failed: " + error.what());
  } catch (...) {
    throw Error(ErrorCode::plugin, component + " failed: it threw what is not a std::exception");
  }
}

}  // namespace cairn
