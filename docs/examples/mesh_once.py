#!/usr/bin/env python3
"""Meshes a surface with one call: mesh_once.py ADDRESS SURFACE SPEC.json OUT.vtu

Needs python3-grpcio, python3-protobuf and the generated stubs:
    mkdir -p build/python
    protoc -I proto --python_out=build/python --grpc_out=build/python \
        --plugin=protoc-gen-grpc=/usr/bin/grpc_python_plugin proto/strata/v1/*.proto
    PYTHONPATH=build/python python3 docs/examples/mesh_once.py localhost:50051 wing.stl wing.json wing.vtu
"""
import pathlib
import sys

import grpc
from strata.v1 import job_pb2, job_pb2_grpc


def request_for(surface, spec):
    # Inline bytes suit surfaces of a few MiB. Larger ones travel in frames, each with its CRC32C, after `open`.
    return job_pb2.GenerateMeshRequest(open=job_pb2.GenerateMeshOpen(job=job_pb2.CreateJobRequest(
        surface=job_pb2.Surface(data=surface.read_bytes(), file_name=surface.name),
        spec_json=spec.read_text(),
        outputs=[job_pb2.OUTPUT_FORMAT_VTU])))


def main(address, surface, spec, out):
    with grpc.insecure_channel(address, options=[("grpc.max_receive_message_length", 8 << 20)]) as channel, open(out, "wb") as file:
        stub = job_pb2_grpc.JobServiceStub(channel)
        for answer in stub.GenerateMesh(iter([request_for(pathlib.Path(surface), pathlib.Path(spec))])):
            part = answer.WhichOneof("part")
            if part == "event" and answer.event.WhichOneof("event") == "stage_ended":
                ended = answer.event.stage_ended
                print(f"{job_pb2.Stage.Name(ended.stage)}: {ended.seconds:.2f} s")
            elif part == "event" and answer.event.WhichOneof("event") == "adjustment":
                print(f"adjusted: {answer.event.adjustment.message}")
            elif part == "frame":
                file.write(answer.frame.data)
            elif part == "done":
                job = answer.done
                print(f"{job_pb2.JobState.Name(job.state)}: {job.hexes} hexes, scaled Jacobian at least {job.quality.all.min:.3f}")


if __name__ == "__main__":
    try:
        main(*sys.argv[1:])
    except grpc.RpcError as error:
        sys.exit(f"{error.code().name}: {error.details()}")
