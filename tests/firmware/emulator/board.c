/* An emulated Arduino Uno: simavr's ATmega328P with its UART, its EEPROM in a file, and one chip on its TWI.
 *
 * A shared library; board.py drives it and says what the chip answers. What simavr 1.6 leaves out of the hardware and
 * a firmware could come to grief on is added here: a UART that holds two unread bytes and loses the next one, an EEPROM
 * that is busy for 3.4 ms after a byte, which is lost if the power fails meanwhile, and a chip that holds the bus.
 */
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "avr_eeprom.h"
#include "avr_twi.h"
#include "avr_uart.h"
#include "sim_avr.h"
#include "sim_elf.h"
#include "sim_io.h"

DEFINE_FIFO(uint16_t, uart_fifo);

enum {
    LINE_BYTES = 1 << 16,
    CHIP_ADDRESS = 0x68,
    FIFO_R_W = 0x74,
    UNREAD_BYTES = 2, /* ATmega328P data sheet, 19.7.5: a third one waits in the shift register */
    EEPROM_US = 3400, /* the same, table 8-1 */
    EEPE = 1,
    DDRC = 0x27,
    SCL = 1 << 5,
    ADDRESS_ACK = 0x18, /* the same, table 21-3 */
    ADDRESS_NACK = 0x20,
    DATA_ACK = 0x28,
    DATA_NACK = 0x30,
    CLOCKS_TO_FREE = 9 /* the rest of a byte and its acknowledge (I2C specification, UM10204, 3.1.16) */
};

/* What is the matter with the chip. */
enum { SOUND, NO_ADDRESS, NO_DATA, HOLDS_BUS };

/* The chip: a byte read from or written to a register, in the transfer that began at a cycle. */
typedef uint8_t (*chip_read_t)(uint8_t address, uint64_t cycle);
typedef void (*chip_write_t)(uint8_t address, uint8_t value, uint64_t cycle);

struct line {
    uint8_t bytes[LINE_BYTES];
    uint32_t first, count;
};

struct board {
    avr_t *avr;
    avr_uart_t *uart;
    avr_eeprom_t *eeprom;
    avr_irq_t *twi;
    avr_twi_t *twi_module;
    chip_read_t chip_read;
    chip_write_t chip_write;
    uint64_t transfer_began;
    uint8_t chip_register, chip_selected, register_is_next, fault, clocks, direction, addressed;
    struct line to_avr, from_avr;
    uint32_t overruns;
    uint16_t written_at;
};

static int put(struct line *line, uint8_t byte) {
    if (line->count == LINE_BYTES) {
        return 0;
    }
    line->bytes[(line->first + line->count++) % LINE_BYTES] = byte;
    return 1;
}

static uint8_t take(struct line *line) {
    uint8_t byte = line->bytes[line->first];
    line->first = (line->first + 1) % LINE_BYTES;
    line->count--;
    return byte;
}

static void on_transmitted(avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    struct board *board = param;
    if (!put(&board->from_avr, (uint8_t)value)) {
        board->overruns++;
    }
}

static avr_cycle_count_t deliver(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)avr;
    struct board *board = param;
    uint8_t byte = take(&board->to_avr);
    if (uart_fifo_get_read_size(&board->uart->input) > UNREAD_BYTES) {
        board->overruns++;
    } else {
        avr_raise_irq(board->uart->io.irq + UART_IRQ_INPUT, byte);
    }
    return board->to_avr.count ? when + board->uart->cycles_per_byte : 0;
}

/* What goes over the TWI. The register is the first byte written; a read goes on behind it, but for FIFO_R_W. */
static void on_twi(avr_irq_t *irq, uint32_t value, void *param) {
    (void)irq;
    struct board *board = param;
    avr_twi_msg_irq_t message = {.u.v = value};
    uint8_t what = message.u.twi.msg;
    if (what & TWI_COND_STOP) {
        board->chip_selected = 0;
    }
    if (what & TWI_COND_START) {
        board->chip_selected = message.u.twi.addr >> 1 == CHIP_ADDRESS && board->fault != NO_ADDRESS;
        board->register_is_next = 1;
        board->transfer_began = board->avr->cycle;
        board->addressed = 1;
        if (board->chip_selected) {
            avr_raise_irq(board->twi + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_ACK, message.u.twi.addr, 1));
        }
        return;
    }
    if (!board->chip_selected) {
        return;
    }
    if (what & TWI_COND_WRITE && board->fault != NO_DATA) {
        avr_raise_irq(board->twi + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_ACK, message.u.twi.addr, 1));
        if (board->register_is_next) {
            board->chip_register = message.u.twi.data;
            board->register_is_next = 0;
        } else {
            board->chip_write(board->chip_register++, message.u.twi.data, board->transfer_began);
        }
    }
    if (what & TWI_COND_READ) {
        uint8_t byte = board->chip_read(board->chip_register, board->transfer_began);
        board->chip_register += board->chip_register != FIFO_R_W;
        avr_raise_irq(board->twi + TWI_IRQ_INPUT, avr_twi_irq_msg(TWI_COND_READ, message.u.twi.addr, byte));
    }
}

/* simavr gives an address for writing the state of data. What the TWI was told to do never ends while the bus is held. */
static void on_twi_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    (void)address;
    (void)value;
    struct board *board = param;
    avr_twi_t *twi = board->twi_module;
    if (board->addressed && (twi->next_twstate == DATA_ACK || twi->next_twstate == DATA_NACK)) {
        twi->next_twstate = twi->next_twstate == DATA_ACK ? ADDRESS_ACK : ADDRESS_NACK;
    }
    board->addressed = 0;
    avr_cycle_timer_slot_t *slot = avr->cycle_timers.timer;
    while (slot && slot->param != twi) {
        slot = slot->next;
    }
    if (slot && board->fault == HOLDS_BUS) {
        avr_cycle_timer_cancel(avr, slot->timer, twi);
    }
}

/* SCL pulled low by the port: after enough of that the chip lets go. */
static void on_direction(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *board = param;
    avr->data[address] = value;
    board->clocks += value & SCL && !(board->direction & SCL);
    board->direction = value;
    if (board->fault == HOLDS_BUS && board->clocks >= CLOCKS_TO_FREE) {
        board->fault = SOUND;
    }
}

static avr_cycle_count_t eeprom_done(avr_t *avr, avr_cycle_count_t when, void *param) {
    (void)when;
    struct board *board = param;
    avr->data[board->eeprom->r_eecr] &= (uint8_t)~(1 << EEPE);
    return 0;
}

/* simavr has written the byte and cleared EEPE already; it stays set for as long as the hardware takes. */
static void on_eeprom_control(avr_t *avr, avr_io_addr_t address, uint8_t value, void *param) {
    struct board *board = param;
    int busy = avr_cycle_timer_status(avr, eeprom_done, board) != 0;
    if (busy) {
        avr->data[address] |= 1 << EEPE;
    } else if (value & 1 << EEPE) {
        avr->data[address] |= 1 << EEPE;
        board->written_at = (uint16_t)(avr->data[board->eeprom->r_eearl] | avr->data[board->eeprom->r_eearh] << 8);
        avr_cycle_timer_register_usec(avr, EEPROM_US, eeprom_done, board);
    }
}

static void no_sleep(avr_t *avr, avr_cycle_count_t cycles) {
    (void)avr;
    (void)cycles;
}

static void no_log(avr_t *avr, const int level, const char *format, va_list arguments) {
    (void)avr;
    (void)level;
    (void)format;
    (void)arguments;
}

static void *module(avr_t *avr, const char *kind) {
    avr_io_t *io = avr->io_port;
    while (io && strcmp(io->kind, kind) != 0) {
        io = io->next;
    }
    return io;
}

/* The EEPROM's bytes are the file's from now on, so that they outlive even a kill. */
static int map_eeprom(avr_eeprom_t *eeprom, const char *path) {
    int file = open(path, O_RDWR);
    if (file < 0) {
        return 0;
    }
    void *bytes = mmap(NULL, eeprom->size, PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    close(file);
    if (bytes == MAP_FAILED) {
        return 0;
    }
    free(eeprom->eeprom);
    eeprom->eeprom = bytes;
    return 1;
}

static void connect_board(struct board *board) {
    avr_t *avr = board->avr;
    board->uart = module(avr, "uart");
    board->twi_module = module(avr, "twi");
    board->twi = avr_io_getirq(avr, AVR_IOCTL_TWI_GETIRQ(0), 0);
    uint32_t quiet = 0;
    avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &quiet);
    avr_irq_register_notify(board->uart->io.irq + UART_IRQ_OUTPUT, on_transmitted, board);
    avr_irq_register_notify(board->twi + TWI_IRQ_OUTPUT, on_twi, board);
    avr_register_io_write(avr, board->eeprom->r_eecr, on_eeprom_control, board);
    avr_register_io_write(avr, board->twi_module->r_twcr, on_twi_control, board);
    avr_register_io_write(avr, DDRC, on_direction, board);
}

/* A board with the firmware of `elf` and 1 KiB of EEPROM in the file `eeprom`; NULL where a file cannot be used. */
struct board *board_open(const char *elf, const char *eeprom, chip_read_t chip_read, chip_write_t chip_write) {
    elf_firmware_t firmware;
    memset(&firmware, 0, sizeof firmware);
    avr_global_logger_set(no_log);
    if (elf_read_firmware(elf, &firmware)) {
        return NULL;
    }
    struct board *board = calloc(1, sizeof *board);
    board->chip_read = chip_read;
    board->chip_write = chip_write;
    board->avr = avr_make_mcu_by_name("atmega328p");
    avr_init(board->avr);
    board->avr->frequency = 16000000;
    board->avr->sleep = no_sleep;
    avr_load_firmware(board->avr, &firmware);
    board->eeprom = module(board->avr, "eeprom");
    if (!map_eeprom(board->eeprom, eeprom)) {
        return NULL;
    }
    connect_board(board);
    return board;
}

/* Run until the clock shows `until` cycles; whether the processor is still sane. */
int board_run(struct board *board, uint64_t until) {
    while (board->avr->cycle < until) {
        int state = avr_run(board->avr);
        if (state == cpu_Done || state == cpu_Crashed) {
            return 0;
        }
    }
    return 1;
}

uint64_t board_cycle(const struct board *board) {
    return board->avr->cycle;
}

/* Bytes on their way to the AVR, one after the other at the line's speed; how many of them there was room for. */
uint32_t board_send(struct board *board, const uint8_t *bytes, uint32_t count) {
    uint32_t sent = 0;
    if (count && !board->to_avr.count) {
        avr_cycle_timer_register(board->avr, board->uart->cycles_per_byte, deliver, board);
    }
    while (sent < count && put(&board->to_avr, bytes[sent])) {
        sent++;
    }
    return sent;
}

/* At most `size` of the bytes that the AVR has sent; how many they are. */
uint32_t board_receive(struct board *board, uint8_t *bytes, uint32_t size) {
    uint32_t count = 0;
    while (count < size && board->from_avr.count) {
        bytes[count++] = take(&board->from_avr);
    }
    return count;
}

/* From now on: 0 sound, 1 does not acknowledge its address, 2 nor data, 3 holds the bus until SCL has clocked it free. */
void board_fault(struct board *board, uint8_t fault) {
    board->fault = fault;
    board->clocks = 0;
}

/* A register of the processor, as a fault of it may set it. */
void board_poke(struct board *board, uint16_t address, uint8_t value) {
    avr_t *avr = board->avr;
    avr_io_addr_t io = AVR_DATA_TO_IO(address);
    if (avr->io[io].w.c) {
        avr->io[io].w.c(avr, address, value, avr->io[io].w.param);
    } else {
        avr->data[address] = value;
    }
}

/* What was lost on the line because nobody took it in time. */
uint32_t board_overruns(const struct board *board) {
    return board->overruns;
}

/* The power fails: a byte that is being written to the EEPROM is left as `torn`. */
void board_close(struct board *board, uint8_t torn) {
    if (avr_cycle_timer_status(board->avr, eeprom_done, board)) {
        board->eeprom->eeprom[board->written_at] = torn;
    }
    munmap(board->eeprom->eeprom, board->eeprom->size);
    board->eeprom->eeprom = NULL;
    avr_terminate(board->avr);
    free(board);
}
