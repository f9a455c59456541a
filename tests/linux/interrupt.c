// SPDX-License-Identifier: MIT
/* MPU-6050s on an adapter, each with an interrupt that a timer raises: what a device tree and INT wires are to a board.
 *
 * insmod interrupt.ko adapter=1 addresses=0x68,0x69 period_us=20000
 */
#include <linux/hrtimer.h>
#include <linux/i2c.h>
#include <linux/irq.h>
#include <linux/module.h>
#include <linux/property.h>

#define MOST 4

static int adapter;
static ushort addresses[MOST];
static uint count;
static uint period_us = 20000;
module_param(adapter, int, 0444);
module_param_array(addresses, ushort, &count, 0444);
module_param(period_us, uint, 0444);

static const char *const rows[] = { "0", "1", "0", "-1", "0", "0", "0", "0", "1" };
static const struct property_entry mounted[] = { PROPERTY_ENTRY_STRING_ARRAY("mount-matrix", rows), {} };
static const struct software_node nodes[MOST] = {
	{ .properties = mounted }, { .properties = mounted }, { .properties = mounted }, { .properties = mounted },
};
static struct i2c_client *clients[MOST];
static int first_irq;
static struct hrtimer timer;

static enum hrtimer_restart measured(struct hrtimer *self)
{
	uint i;

	for (i = 0; i < count; i++)
		generic_handle_irq_safe(first_irq + i);
	hrtimer_forward_now(self, ns_to_ktime((u64)period_us * NSEC_PER_USEC));
	return HRTIMER_RESTART;
}

static void leave(void)
{
	uint i;

	for (i = 0; i < count; i++)
		i2c_unregister_device(clients[i]);
	irq_free_descs(first_irq, count);
}

static int __init enter(void)
{
	struct i2c_adapter *bus = i2c_get_adapter(adapter);
	int failed = 0;
	uint i;

	if (!bus || !count)
		return -ENODEV;
	first_irq = irq_alloc_descs(-1, 1, count, NUMA_NO_NODE);
	if (first_irq < 0) {
		i2c_put_adapter(bus);
		return first_irq;
	}
	for (i = 0; i < count && !failed; i++) {
		struct i2c_board_info chip = { .type = "mpu6050", .addr = addresses[i], .irq = first_irq + i };
		struct i2c_client *made;

		chip.swnode = &nodes[i];
		irq_set_chip_and_handler(chip.irq, &dummy_irq_chip, handle_simple_irq);
		irq_modify_status(chip.irq, IRQ_NOREQUEST | IRQ_NOPROBE, IRQ_TYPE_EDGE_RISING);
		made = i2c_new_client_device(bus, &chip);
		if (IS_ERR(made))
			failed = PTR_ERR(made);
		else
			clients[i] = made;
	}
	i2c_put_adapter(bus);
	if (failed) {
		leave();
		return failed;
	}
	hrtimer_init(&timer, CLOCK_MONOTONIC, HRTIMER_MODE_REL);
	timer.function = measured;
	hrtimer_start(&timer, ns_to_ktime((u64)period_us * NSEC_PER_USEC), HRTIMER_MODE_REL);
	return 0;
}

static void __exit end(void)
{
	hrtimer_cancel(&timer);
	leave();
}

module_init(enter);
module_exit(end);
MODULE_LICENSE("Dual MIT/GPL");
MODULE_DESCRIPTION("MPU-6050s with interrupts, for tests");
