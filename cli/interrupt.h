#pragma once

namespace lobefit {

/// From here on, the first Ctrl-C only asks: monitors throw Interrupted at their next check().
void catch_interrupts();

}  // namespace lobefit
