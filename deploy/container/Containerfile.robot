# The reference robot with ROS 2 Jazzy from PyPI (x86-64): REST on 7003, SOAP on 5555. No compiler, no root.
# From the repository's root: docker build -f deploy/container/Containerfile.robot -t roaas-robot:0.1.0 .
# To run it: docker run --rm -p 127.0.0.1:7003:7003 -p 127.0.0.1:5555:5555 roaas-robot:0.1.0
# In front of a robot on the network: docker run --rm --network host --ipc host -e ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET \
#   -v $PWD/token:/token:ro roaas-robot:0.1.0 --attach --token-file /token, see docs/robots.md.
# The full image has the compiler that the interface packages are built with.
FROM python:3.11.14-bookworm AS build
COPY . /src
RUN python -m venv /opt/roaas \
    && /opt/roaas/bin/python -m pip install --no-cache-dir --no-compile --constraint /src/constraints.txt '/src[robot,ros]' \
    && /opt/roaas/bin/python -m pip install --no-cache-dir --no-compile --no-deps \
       /src/reference_robot/interfaces/mybot_delivery_app /src/reference_robot/interfaces/nav2_msgs \
       /src/reference_robot/interfaces/tf2_msgs \
    && /opt/roaas/bin/python -m pip uninstall --yes pip setuptools

FROM python:3.11.14-slim-bookworm
COPY --from=build /opt/roaas /opt/roaas
RUN useradd --create-home --uid 10001 roaas
ENV PATH=/opt/roaas/bin:$PATH PYTHONUNBUFFERED=1 ROS_AUTOMATIC_DISCOVERY_RANGE=LOCALHOST
USER 10001
WORKDIR /home/roaas
EXPOSE 7003 5555
# Whatever token and TLS it asks for, it does not leave a client waiting: it answers, or hangs up.
HEALTHCHECK --interval=5s --timeout=3s --start-period=20s CMD \
    ["python", "-c", "import socket as s; c = s.create_connection(('127.0.0.1', 7003), 2); c.sendall(b'OPTIONS * HTTP/1.0\\r\\n\\r\\n'); c.recv(1)"]
ENTRYPOINT ["roaas", "robot", "--host", "0.0.0.0"]
# Who may reach it is for the published ports to say; or replace this by --token-file and TLS (docs/security.md).
CMD ["--insecure"]
