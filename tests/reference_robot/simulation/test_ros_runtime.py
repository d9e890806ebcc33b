"""The ROS runtime: it spins, survives a failing callback, and leaves nothing behind."""

import threading

import pytest
from observer import until
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.serialization import deserialize_message
from rclpy.task import Future
from std_msgs.msg import String

from reference_robot.names import RosNames
from reference_robot.ros import RosRuntime, waiting_messages
from reference_robot.simulation.runner import Simulation


def test_a_failing_callback_stops_no_other(domain_id):
    calls = []

    def fail():
        calls.append("failing")
        raise ValueError("on purpose")

    with RosRuntime(domain_id) as ros:
        node = ros.create_node("twin")
        node.create_timer(0.005, fail)
        node.create_timer(0.005, lambda: calls.append("sound"))
        ros.start()
        until(lambda: calls.count("failing") > 3 and calls.count("sound") > 3)


@pytest.mark.parametrize("apart", [False, True])
def test_a_failing_task_ends_no_process(domain_id, apart):
    """EventsExecutor crashes the process if it has exactly one node: two robots on one domain ended each other."""

    def fail(_done):
        failed.append(1)
        raise ValueError("on purpose")

    failed, calls = [], []
    with RosRuntime(domain_id) as ros:
        node = ros.create_node("only", apart=apart)
        future = Future(executor=node.executor)
        future.add_done_callback(fail)
        ros.start()
        future.set_result(None)
        until(lambda: failed)
        node.create_timer(0.005, lambda: calls.append(1))
        until(lambda: calls)


def test_a_closed_runtime_leaves_no_node_on_the_graph_and_no_thread(domain_id):
    threads = set(threading.enumerate())
    with RosRuntime(domain_id) as watching:
        watcher = watching.create_node("watcher")
        watching.start()
        for _ in range(3):
            with RosRuntime(domain_id) as ros:
                simulation = Simulation(ros, RosNames())
                ros.start()
                until(lambda: {"base", "navigation", "delivery"} <= set(watcher.get_node_names()))
            until(lambda: watcher.get_node_names() == ["watcher"])
            assert simulation  # it is closing that ends the nodes, and not the garbage collector
    # Threads of tests before may have ended meanwhile.
    assert set(threading.enumerate()) <= threads


def test_closing_twice_and_starting_twice_do_nothing_more(domain_id):
    ros = RosRuntime(domain_id)
    ros.create_node("idle")
    ros.start()
    ros.start()
    ros.close()
    ros.close()


def test_without_a_number_the_domain_is_the_environments(domain_id):
    got = []
    with RosRuntime() as here, RosRuntime(domain_id) as there:
        here.create_node("hears").create_subscription(String, "word", got.append, 10)
        publisher = there.create_node("says").create_publisher(String, "word", 10)
        here.start()
        until(publisher.get_subscription_count)
        publisher.publish(String(data="hello"))
        until(lambda: got)
    assert here.domain_id == domain_id


def test_what_comes_to_a_node_that_is_not_spun_is_taken_by_hand_in_order(domain_id):
    keep_all = QoSProfile(history=HistoryPolicy.KEEP_ALL)
    called = []
    with RosRuntime(domain_id) as ros:
        waiting = ros.create_node("waits", spun=False).create_subscription(
            String, "word", called.append, keep_all, raw=True
        )
        publisher = ros.create_node("says").create_publisher(String, "word", keep_all)
        ros.start()
        until(publisher.get_subscription_count)
        assert list(waiting_messages(waiting)) == []
        words = [f"word {number}" for number in range(100)]
        for word in words:
            publisher.publish(String(data=word))
        came = []
        until(lambda: came.extend(waiting_messages(waiting)) or len(came) == len(words))
        assert [deserialize_message(octets, String).data for octets in came] == words
        assert list(waiting_messages(waiting)) == []
    assert called == []


def test_who_watches_is_called_once_for_what_waits_in_the_thread_of_a_node(domain_id):
    batches, threads = [], []
    with RosRuntime(domain_id) as ros, RosRuntime(domain_id) as there:
        node = ros.create_node("takes", apart=True)
        waiting = ros.create_node("waits", spun=False).create_subscription(String, "word", print, 1000, raw=True)

        def take():
            threads.append(threading.current_thread())
            batches.append(list(waiting_messages(waiting)))

        ros.watch(waiting, node, take, 0.2)
        node.create_timer(0.01, lambda: threads.append(threading.current_thread()))
        publisher = there.create_node("says").create_publisher(String, "word", 1000)
        ros.start()
        until(publisher.get_subscription_count)
        for number in range(100):
            publisher.publish(String(data=str(number)))
        until(lambda: sum(map(len, batches)) == 100)
        publisher.publish(String(data="last"))
        until(lambda: sum(map(len, batches)) == 101)
    assert len(batches) <= 4
    assert len(set(threads)) == 1
    assert deserialize_message(batches[-1][-1], String).data == "last"


@pytest.mark.parametrize("domain", [-1, 102])
def test_a_domain_outside_the_range_is_named(domain):
    with pytest.raises(ValueError, match=str(domain)):
        RosRuntime(domain)


def test_the_simulation_names_a_time_scale_that_it_cannot_use(domain_id):
    with RosRuntime(domain_id) as ros, pytest.raises(ValueError, match="-2"):
        Simulation(ros, RosNames(), -2.0)
